"""`risk-sac egos`: lists egos and defects; compares egos under one search."""

import argparse
import os
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from risk_sac.cli.console import FAILED, INTERRUPTED, OK, Board, folded_table, print_answer, progress_bar, say
from risk_sac.cli.flags import add_campaign_flags, campaign_flags, kept_name, named_ego
from risk_sac.cli.parser import Commands, add_command, add_group, add_json_flag
from risk_sac.cli.run import drawn
from risk_sac.config import EgoConfig
from risk_sac.config.ego import ACTUATOR_PRESETS, SENSOR_PRESETS
from risk_sac.config.spec_file import PROFILES, read_campaign
from risk_sac.egos.defects.catalogue import DEFECTS
from risk_sac.egos.registry import SHIPPED, cards
from risk_sac.host.machine import cores
from risk_sac.host.terminal import complain
from risk_sac.metrics import COLUMNS as REQUIREMENT_COLUMNS
from risk_sac.metrics import pooled_counts, pooled_requirements, requirement_cells, wilson_interval, with_published
from risk_sac.scenario.reading import shipped_names

if TYPE_CHECKING:
    from risk_sac.report import FinishedRun

SEEDS = 2
COLUMNS = (
    *("family", "ego", "runs", "episodes", "invalid", "contacts"),
    *("valid", "ECR (95 %)", "preventable (published)", "PCR (95 %)", "failures"),
)


CHECKED = ("scenario", "decision / step\nmedian, worst\nlate", "clipped", "drove\nstood", "offset", "wrong")


def add(commands: Commands) -> None:
    """Adds the commands."""
    egos = add_group(
        commands, "egos", "list and compare egos, the vehicles under test", example="egos list"
    ).add_subparsers(required=True, metavar="COMMAND")
    add_command(
        egos, "list", _list, "list SUMO's driver models, the shipped egos and the registered ones", example="egos list"
    )
    add_command(
        egos,
        "defects",
        _defects,
        "list known faults that can be planted into an ego",
        more="A defect follows the name of an ego, such as idm-aeb+blind-right.",
        example="egos defects",
    )
    check = add_command(
        egos,
        "check",
        _check,
        "drive a scene of each shipped scenario without an attack, and tell whether the ego is fit for a search",
        more="Ends with status 1 if the ego fails, touches something, or does not move.",
        example="egos check idm-aeb --scenario low mixed --out runs/check",
    )
    check.add_argument("ego", metavar="EGO", help="a registered ego, also with defects and presets")
    scenarios = "scenarios, or files of them (default: all that ship)"
    check.group("scene").add_argument("--scenario", nargs="+", metavar="NAME", help=scenarios)
    check.group("output").add_argument("--out", type=Path, metavar="DIR", help="draw each scene into DIR/SCENARIO.png")
    add_json_flag(check)
    ladder = add_command(
        egos,
        "ladder",
        _ladder,
        "run the same search on equal budgets against each ego",
        more="The same command again continues an interrupted comparison.",
        example="egos ladder --egos default careful --episodes 50 --out runs/ladder",
    )
    names = ["default", *SHIPPED]
    ladder.group("scene").add_argument(
        "--egos", nargs="+", default=names, metavar="EGO", help=f"(default: {' '.join(names)})"
    )
    add_campaign_flags(ladder, families="low", methods="archive", seeds=SEEDS)
    jobs = "runs at a time (default: one per core)"
    ladder.group("execution").add_argument("--jobs", type=int, metavar="N", help=jobs)
    out = "a folder for each ego, and ladder.md"
    ladder.group("output").add_argument("--out", type=Path, required=True, metavar="DIR", help=out)


def _list(options: argparse.Namespace) -> int:
    rows = [
        [name, "sumo", f"{EgoConfig.model_validate({'profile': name}).response_s:g} s", "SUMO's models"]
        for name in PROFILES
    ]
    for card in cards():
        rows.append([card.name, card.kind, f"{card.response_time_s:g} s", f"{card.summary} Version {card.version}"])
    say(folded_table(("name", "kind", "responds\nwithin", "summary"), rows))
    presets = f"{', '.join(SENSOR_PRESETS)}; actuators: {', '.join(ACTUATOR_PRESETS)}"
    say(f"A registered ego may have imperfect equipment, as EGO@PRESET. Sensors: {presets}.")
    return OK


def _defects(options: argparse.Namespace) -> int:
    rows = [
        [f"{name}\n{defect.kind}", f"{defect.base}\n{' '.join(defect.families)}", defect.sentence]
        for name, defect in DEFECTS.items()
    ]
    say(folded_table(("defect\nkind", "ego\nfamilies", "sentence"), rows))
    return OK


def _check(options: argparse.Namespace) -> int:
    ego = named_ego(options.ego)
    from risk_sac.failures.trials import try_ego, unusable

    trials = []
    for name in options.scenario or shipped_names():
        trial, drawn = try_ego(ego, kept_name(name))
        trials.append(trial)
        if options.out is not None and drawn is not None:
            options.out.mkdir(parents=True, exist_ok=True)
            (options.out / f"{trial.scenario}.png").write_bytes(drawn)
    rows = [
        [
            trial.scenario,
            f"{trial.decision_ratio:.3f}, {trial.worst_ratio:.3f}\n{trial.late} of {trial.steps}",
            str(trial.clipped),
            f"{trial.driven_m:.0f} m\n{trial.stood_s:.1f} s",
            f"{trial.farthest_offset_m:.1f} m",
            ", ".join(filter(None, (trial.failed, trial.contact and f"contact: {trial.contact}", *trial.violated))),
        ]
        for trial in trials
    ]
    reasons = unusable(trials)
    verdict = "\n".join(f"- {reason}" for reason in reasons) or "It is fit for a search."
    print_answer(options, {"trials": trials, "unusable": reasons}, folded_table(CHECKED, rows), verdict)
    return FAILED if reasons else OK


def _ladder(options: argparse.Namespace) -> int:
    defaults = {"families": ["low"], "methods": ["archive"], "seeds": list(range(SEEDS))}
    spec = read_campaign(options.spec, campaign_flags(options, SEEDS), defaults)
    egos = {name: named_ego(name) for name in options.egos}
    # Here, because loading what checks the settings takes seconds.
    from risk_sac.execution.evaluate import evaluate
    from risk_sac.report.rendering import table

    runs_by_ego: dict[str, Sequence[FinishedRun]] = {}
    jobs, executor = options.jobs or cores(), os.environ.get("RISK_SAC_EXECUTOR", "local")
    for name, ego in egos.items():
        with progress_bar() as bar:
            campaign, folder = spec.model_copy(update={"ego": ego}), options.out / name
            evaluation = evaluate(campaign, folder, options.typed, jobs, partial(drawn, Board(bar)), executor, 0)
        for job in evaluation.failed:
            complain(f"{name}: {job.name}: {job.reason}")
        if evaluation.stopped:
            return INTERRUPTED
        runs_by_ego[name] = evaluation.comparison.runs
    rows = [row for family in spec.families for row in _rows(family, runs_by_ego)]
    text = table(COLUMNS, rows, left=2)
    if requirements := [row for family in spec.families for row in _requirements(family, runs_by_ego)]:
        text += "\n" + table(["family", "ego", *REQUIREMENT_COLUMNS], requirements, left=4)
    (options.out / "ladder.md").write_text(f"`{options.typed}`\n\n{text}", encoding="utf-8")
    say(folded_table(COLUMNS, rows))
    if requirements:
        say(folded_table(("family", "ego", *REQUIREMENT_COLUMNS), requirements))
    return OK if all(runs_by_ego.values()) else FAILED


def _rows(family: str, found: "dict[str, Sequence[FinishedRun]]") -> list[list[str]]:
    """Returns a family's rows by ego, worst first; Wilson intervals, pooled episodes."""
    rows: list[tuple[tuple[float, float], list[str]]] = []
    for name, runs in found.items():
        of_family = [run.metrics["search"] for run in runs if run.spec.family == family]
        if not of_family:
            continue
        pooled = pooled_counts(of_family)
        valid, preventable, rated = pooled.collisions, pooled.preventable_collisions, pooled.rated
        counts = map(str, (len(of_family), pooled.episodes, pooled.invalid, pooled.raw_collisions, valid))
        by_published = with_published(preventable, sum(run.prevented_by.get("published", 0) for run in of_family))
        rates = _rate(valid, rated), by_published, _rate(preventable, rated), str(pooled.failures)
        rows.append(((preventable / max(rated, 1), valid / max(rated, 1)), [family, name, *counts, *rates]))
    return [row for _, row in sorted(rows, key=lambda each: each[0], reverse=True)]


def _requirements(family: str, found: "dict[str, Sequence[FinishedRun]]") -> Iterator[list[str]]:
    for name, runs in found.items():
        pooled = pooled_requirements([run.metrics["search"] for run in runs if run.spec.family == family])
        yield from ([family, name, *requirement_cells(each, counts)] for each, counts in pooled.items())


def _rate(count: int, rated: int) -> str:
    low, high = wilson_interval(count, rated)
    return f"{count / max(rated, 1):.3f} ({low:.3f} to {high:.3f})"
