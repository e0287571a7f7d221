"""`risk-sac run` and `evaluate`: a run, or compared methods, without server."""

import argparse
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from risk_sac.cli.console import (
    FAILED,
    INTERRUPTED,
    OK,
    Board,
    counted,
    driven_by_in_words,
    headline,
    or_dash,
    print_answer,
    progress_bar,
    requirements_table,
    say_adjustments,
)
from risk_sac.cli.flags import (
    add_budget_flags,
    add_campaign_flags,
    add_map_flags,
    add_prior_flag,
    add_scene_flags,
    budget_flags,
    campaign_flags,
    families_on_map,
    kept_name,
    scene_flags,
)
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.config import METHODS, RunSpec
from risk_sac.config.methods import named_methods
from risk_sac.config.spec_file import read_campaign, read_spec
from risk_sac.env.problem import adjustments
from risk_sac.errors import ConfigError
from risk_sac.host.machine import check_batch, cores
from risk_sac.host.terminal import complain, console, notes
from risk_sac.metrics import METRICS, Metric, with_published
from risk_sac.records import RunMetrics
from risk_sac.run_folder.results import TIMES, RunResults
from risk_sac.scenario.families import family_named
from risk_sac.scenario.odd import wider_behaviour
from risk_sac.scenario.reading import PAPER_FAMILIES

if TYPE_CHECKING:
    from risk_sac.execution.jobs import Job

SEEDS = 5  # number of seeds of a comparison that names none


def add(commands: Commands) -> None:
    """Adds the commands."""
    run = add_command(
        commands,
        "run",
        _run,
        "search for failures with one method and one seed",
        more="No server is needed. The same command again continues an interrupted run.",
        example="run --scenario low --method archive --episodes 100 --out runs/low",
    )
    named = "scenario that ships, is kept or in a file; `risk-sac scenarios list`"
    run.group("scene").add_argument("--scenario", dest="family", metavar="NAME_OR_FILE", help=named)
    add_scene_flags(run)
    add_map_flags(run, several=False)
    search = run.group("search")
    search.add_argument("--method", metavar="NAME", help=f"one of {', '.join(named_methods())} (default: risk-sac)")
    search.add_argument("--seed", type=int, metavar="S", help="(default: 0)")
    search.add_argument(
        "--spec", type=Path, metavar="FILE.yaml", help="settings of a run or campaign; flags override them"
    )
    add_prior_flag(run)
    add_budget_flags(run)
    run.group("output").add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the results")
    add_json_flag(run)

    evaluate = add_command(
        commands,
        "evaluate",
        _evaluate,
        "compare methods over seeds",
        more="Writes tables and figures. The same command again continues an interrupted comparison.",
        example="evaluate --scenario low --methods archive random --seeds 3 --episodes 100 --out runs/compared",
    )
    add_campaign_flags(evaluate, families="all", methods="all", seeds=SEEDS)
    add_scene_flags(evaluate)
    add_prior_flag(evaluate)
    add_map_flags(evaluate, several=True)
    execution = evaluate.group("execution")
    jobs = "processes that play episodes (default: one per core, or as many as a cluster has room for)"
    execution.add_argument("--jobs", type=int, metavar="N", help=jobs)
    executor = os.environ.get("RISK_SAC_EXECUTOR", "local")
    where = "`local` or, on a cluster, `ray` (default: RISK_SAC_EXECUTOR or local)"
    execution.add_argument("--executor", default=executor, metavar="NAME", help=where)
    times = f"replays of each distinct failure (default: {TIMES})"
    execution.add_argument("--verify", type=int, default=TIMES, metavar="N", help=times)
    out = "folder of runs, tables and figures"
    evaluate.group("output").add_argument("--out", type=Path, required=True, metavar="DIR", help=out)
    add_json_flag(evaluate)


def _run(options: argparse.Namespace) -> int:
    families = families_on_map(options)
    if families:
        options.family = families[0]
    if options.spec is None and options.family is None:
        remedy = "or another scenario or its file, a map with --network, or settings with --spec"
        raise ConfigError("family", "nothing", "low, mixed or dense", remedy)
    options.family = options.family and kept_name(options.family)
    named = {name: getattr(options, name) for name in ("family", "method", "seed", "prior")}
    spec = read_spec(options.spec, named | budget_flags(options) | scene_flags(options))
    check_batch(spec.budget.batch)
    say_adjustments(adjustments(spec))
    results = play_run(spec, options.out, f"{spec.family} {spec.method}", _found)
    if not results.finished:
        done = sum(phase.episodes for phase in (results.metrics, results.evaluation) if phase)
        again = "The same command again goes on from there."
        notes.print(
            f"Stopped after {done} of {counted(spec.budget.total_episodes, 'episode')}. {again}", soft_wrap=True
        )
        return INTERRUPTED
    phases = {"i.i.d." if spec.iid else "search": results.metrics, "evaluation": results.evaluation}
    played = {name: metrics for name, metrics in phases.items() if metrics is not None}
    requirements = requirements_table({name: metrics.requirements for name, metrics in played.items()})
    answer = {"id": spec.id, "folder": str(options.out), "wall_s": results.wall_s, "device": results.device}
    answer |= {"processes": results.processes, **played}
    print_answer(options, answer, _summary(spec, results, played), *([requirements] if requirements else []))
    if options.json:
        return OK
    console.print(f"Results: {options.out}/results.json", soft_wrap=True)
    if any(metrics.headline is None and metrics.headline_candidates for metrics in played.values()):
        console.print(f"Count its headline failures: risk-sac verify {options.out}", soft_wrap=True)
    return OK


def play_run(spec: RunSpec, folder: Path, name: str, found: Callable[[RunMetrics], str]) -> RunResults:
    """Plays or continues a run, and shows its progress.

    `found` puts the metrics into the words beside the bar.
    """
    from risk_sac.execution.evaluate import run  # here, because loading torch takes seconds

    with progress_bar() as bar:
        task = bar.add_task(name, total=spec.budget.total_episodes, found="")

        def advance(done: int, metrics: RunMetrics | None) -> None:
            bar.update(task, completed=done, found=found(metrics) if metrics else "")

        return run(spec, folder, advance)


def _found(metrics: RunMetrics) -> str:
    preventable = with_published(metrics.distinct_preventable, metrics.distinct_published)
    return (
        f"contacts {metrics.raw_collisions} → valid {metrics.collisions}  failures {metrics.failures} → "
        f"distinct {metrics.distinct_failures} → preventable {preventable}  "
        f"sliding ECR {metrics.window_ecr:.2f} PCR {metrics.window_pcr:.2f}  λ {metrics.dual_variable:.3f}"
    )


def _summary(spec: RunSpec, results: RunResults, phases: Mapping[str, RunMetrics]) -> Table:
    columns = {name: _figures(metrics) for name, metrics in phases.items()}
    behaviour = wider_behaviour(family_named(spec.family).odd, spec.odd)
    setting = f"{spec.family} · {behaviour} behaviour"
    by = "1 process" if results.processes == 1 else f"{results.processes} processes"
    title = f"{setting} · {spec.method} · seed {spec.seed} · {results.wall_s:.0f} s by {by} on {results.device}"
    table = Table("", *columns, title=title)
    for figure in next(iter(columns.values()), {}):
        table.add_row(figure, *(column[figure] for column in columns.values()))
    return table


def _figures(metrics: RunMetrics) -> dict[str, str]:
    shown = (metric for metric in METRICS if not metric.search_only)
    return {
        "headline failures": headline(
            metrics.headline, metrics.headline_candidates, len(metrics.headline_kinds_published)
        ),
        "episodes": f"{metrics.episodes} ({metrics.rejected} rejected)",
        "driven by": driven_by_in_words(metrics.episodes_driven_by),
        "contacts": f"{metrics.raw_collisions} ({counted(metrics.artefacts, 'artefact')})",
        "valid contacts": f"{metrics.collisions} ({metrics.unresponsive} unresponsive)",
        "failures of any requirement": f"{metrics.failures}",
        "distinct violations": f"{metrics.distinct_failures} ({counted(metrics.variants, 'variant')})",
        "distinct and preventable": f"{metrics.distinct_preventable}",
        "of these, by R157, FSM or RSS": f"{metrics.distinct_published}",
        "preventable, plausible and not minor": f"{metrics.headline_candidates}",
        "not minor, but implausible": f"{metrics.implausible}",
        **dict(_figure(metric, metrics) for metric in shown),
        "steps per distinct failure": or_dash(metrics.steps_per_distinct_failure, ".0f"),
    }


def _figure(metric: Metric, metrics: RunMetrics) -> tuple[str, str]:
    name, value = f"{metric.words} {metric.symbol}".strip(), metric.value(metrics)
    interval = None if value is None else metric.interval(value, metrics)
    text = or_dash(value, ".3f")
    return (name, text) if interval is None else (f"{name} (95 %)", "{} ({:.3f} to {:.3f})".format(text, *interval))


def _evaluate(options: argparse.Namespace) -> int:
    methods = [name for name, method in METHODS.items() if not method.needs and method.scenes != "boundary"]
    defaults = {"families": list(PAPER_FAMILIES), "methods": methods, "seeds": list(range(SEEDS))}
    options.families = families_on_map(options) or options.families
    spec = read_campaign(options.spec, campaign_flags(options, SEEDS) | scene_flags(options), defaults)
    say_adjustments(adjustments(spec))
    # Here, because loading what checks the settings takes seconds.
    from risk_sac.execution.evaluate import evaluate
    from risk_sac.report.files import table_of

    with progress_bar() as bar:
        fill = cores() if options.executor == "local" else len(spec.runs()) * spec.budget.batch
        jobs = options.jobs if options.jobs is not None else fill
        progress = partial(drawn, Board(bar))
        evaluation = evaluate(spec, options.out, options.typed, jobs, progress, options.executor, options.verify)
    for job in evaluation.failed:
        complain(f"{job.name}: {job.reason}")
    comparison = evaluation.comparison
    runs = f"{len(comparison.runs)} of {counted(len(comparison.runs) + len(comparison.missing), 'run')}"
    written = f"Report of {runs}: {options.out}/table.md, table.json, table.csv, figures/"
    print_answer(options, table_of(comparison), written)
    if evaluation.stopped:
        notes.print("Stopped. The same command again goes on from there.")
        return INTERRUPTED
    return FAILED if comparison.missing else OK


def drawn(board: Board, jobs: "Sequence[Job]") -> None:
    """Draws the progress of runs."""
    done = {job.name: job.episodes for job in jobs}
    finished = sum(job.state == "finished" for job in jobs)
    failed = sum(job.state == "failed" for job in jobs)
    found = f"{finished}/{counted(len(jobs), 'run')}" + (f", {failed} failed" if failed else "")
    at_work = {job.name: (done[job.name], job.total) for job in jobs if job.state == "running"}
    board.show(sum(done.values()), sum(job.total for job in jobs), found, at_work)
