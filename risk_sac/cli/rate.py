"""`risk-sac rate` and `boundary`: how often and where an ego fails, unattacked."""

import argparse
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Column, Table

from risk_sac.cli.console import EGO, INTERRUPTED, OK, counted, print_answer, say_adjustments
from risk_sac.cli.flags import add_scene_flags, assignment, kept_name, named_ego, scene_flags
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.cli.run import play_run
from risk_sac.config.spec_file import read_spec
from risk_sac.env.problem import Problem, adjustments
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.host.terminal import notes
from risk_sac.rates.record import METHOD, check_exposure, rated, rates_of, start_in
from risk_sac.records.rates import BoundaryMap, RateEstimate, Rates
from risk_sac.report.runs import read_records
from risk_sac.run_folder.results import BOUNDARY_PICTURE, EPISODES

DRAWS = 2000
PER_PARAMETER = 40  # episodes of a boundary for each parameter; choice


def add_rate(commands: Commands) -> None:
    """Adds the command."""
    rate = add_command(
        commands,
        "rate",
        _rate,
        "estimate how often an ego fails in a scenario, without an attack",
        more="Scenes are drawn by the scenario's distributions, by importance sampling.\n"
        "The same command again goes on with an interrupted estimate, and repeats the answer of a finished one.",
        example="rate cyclist_ahead --ego idm-aeb+weak-brakes --exposure 12 --out runs/rate",
    )
    named = "scenario that ships, is kept or in a file; `risk-sac scenarios list`"
    rate.add_argument("family", metavar="SCENARIO", help=named)
    add_scene_flags(rate)
    rate.group("budget").add_argument(
        "--draws", dest="episodes", type=int, default=DRAWS, metavar="N", help=f"(default: {DRAWS})"
    )
    rate.group("budget").add_argument("--seed", type=int, metavar="S", help="(default: 0)")
    earlier = "folder of a run or campaign whose failures in this scenario say where to look first (default: none)"
    rate.add_argument("--from", dest="earlier", type=Path, metavar="FOLDER", help=earlier)
    rate.add_argument("--requirement", metavar="NAME", help="only this requirement (default: all that count)")
    exposure = "scenes of this scenario in an hour of driving, for a rate per hour (default: none)"
    rate.add_argument("--exposure", type=float, metavar="PER_HOUR", help=exposure)
    rate.group("output").add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the run")
    add_json_flag(rate)


def _rate(options: argparse.Namespace) -> int:
    named = {"family": kept_name(options.family), "method": METHOD, "seed": options.seed, "episodes": options.episodes}
    start = {} if options.earlier is None else {"rate": start_in(options.earlier, named["family"]).model_dump()}
    spec = read_spec(None, named | scene_flags(options) | start)
    check_exposure(options.exposure)
    known = rated(Problem.from_spec(spec))
    if options.requirement is not None and options.requirement not in known:
        remedy = did_you_mean(options.requirement, known)
        raise ConfigError("requirement", repr(options.requirement), f"one of {', '.join(known)}", remedy)
    say_adjustments(adjustments(spec))
    results = play_run(
        spec, options.out, f"{spec.family} {spec.method}", lambda metrics: f"failures {metrics.failures}"
    )
    answer = rates_of(spec, read_records(options.out / EPISODES), options.exposure)
    if options.requirement is not None:
        only = {options.requirement: answer.rates[options.requirement]}
        answer = answer.model_copy(update={"rates": only})
    objections = (f"{name}: not estimated: {each.why}" for name, each in answer.rates.items() if each.rate is None)
    texts = ("\n".join(objections), _drawn(answer), answer.meaning)
    print_answer(options, answer, _rate_table(answer), *filter(None, texts))
    if not results.finished:
        notes.print(f"Stopped after {counted(answer.draws, 'draw')}. The same command again goes on from there.")
        return INTERRUPTED
    return OK


def _rate_table(answer: Rates) -> Table:
    title = f"{answer.run_id}: {answer.played} of {counted(answer.draws, 'draw')} played"
    checked = ("effective\nfailures", "largest\nshare", "declared\nshare")
    names = ("requirement", "failures", "rate", "95 %", "per hour", *checked)
    table = Table(*(Column(name, overflow="fold") for name in names), box=SIMPLE_HEAD, padding=0, title=title)
    for name, estimate in answer.rates.items():
        shares = (f"{share:.0%}" for share in (estimate.largest_share, estimate.declared_share))
        hour = estimate.per_hour
        hourly = "" if hour is None else f"{hour.rate:.3g} ({hour.low:.3g} to {hour.high:.3g})"
        told = (*_said(estimate), hourly, f"{estimate.effective_failures:.0f}", *shares)
        table.add_row(name, str(estimate.failures), *told)
    return table


def _said(estimate: RateEstimate) -> tuple[str, str]:
    if estimate.rate is None:
        return "-", f"below {estimate.at_most:.2g}"
    return f"{estimate.rate:.3g}", f"{estimate.low:.3g} to {estimate.high:.3g}"


def _drawn(answer: Rates) -> str:
    told = [
        f"{name}: {drawn.kind}, {drawn.source or 'choice'}"
        for name, drawn in answer.distributions.items()
        if drawn.kind != "uniform"
    ]
    alike = [name for name, drawn in answer.distributions.items() if drawn.kind == "uniform"]
    return "\n".join([*told, *([f"uniform, a choice: {', '.join(alike)}"] if alike else [])])


def add_boundary(commands: Commands) -> None:
    """Adds the command."""
    boundary = add_command(
        commands,
        "boundary",
        _boundary,
        "find where an ego goes from passing to failing over two to four parameters",
        more="No attack: the others follow the scenario's story. The same command again goes on.",
        example="boundary cut_in.xosc --over gap speed --ego idm-aeb --beside r157 --out runs/boundary",
    )
    boundary.add_argument("scenario", metavar="SCENARIO", help="name or file; `risk-sac scenarios list`")
    search = boundary.group("search")
    search.add_argument("--over", nargs="+", required=True, metavar="NAME", help="two to four parameters with a range")
    others = "what other parameters do: their median, or drawn (default: fixed)"
    search.add_argument("--others", choices=["fixed", "drawn"], default="fixed", help=others)
    search.add_argument("--at", nargs="+", default=[], metavar="NAME=VALUE", help="value of another parameter")
    requirement = "whose violation is failing (default: a contact, or any requirement that counts)"
    search.add_argument("--requirement", default="", metavar="NAME", help=requirement)
    search.add_argument(
        "--episodes", type=int, metavar="N", help=f"for each ego (default: {PER_PARAMETER} per parameter)"
    )
    search.add_argument("--seed", type=int, metavar="S", help="(default: 0)")
    add_scene_flags(boundary)
    beside = f"other egos over the same parameters, such as r157, rss and defensive: {EGO}"
    boundary.group("scene").add_argument("--beside", nargs="+", default=[], metavar="EGO", help=beside)
    out = "folder of a run for each ego, and of boundary.json and boundary.png"
    boundary.group("output").add_argument("--out", type=Path, required=True, metavar="DIR", help=out)
    add_json_flag(boundary)


def _boundary(options: argparse.Namespace) -> int:
    family = kept_name(options.scenario)
    asked = {
        "over": options.over,
        "others": options.others,
        "at": dict(map(_fixed, options.at)),
        "requirement": options.requirement,
    }
    fields: dict[str, Any] = {
        "family": family,
        "method": "boundary",
        "seed": options.seed,
        "episodes": options.episodes or PER_PARAMETER * len(options.over),
        "boundary": asked,
        **scene_flags(options),
    }
    name = options.ego or "default"
    egos = {name: fields} | {
        other: fields | {"ego": named_ego(other).model_dump(mode="json")} for other in options.beside
    }
    specs = {ego: read_spec(None, own) for ego, own in egos.items()}
    say_adjustments(adjustments(specs[name]))
    from risk_sac.report.parameter_plots import write_boundary
    from risk_sac.search.boundary_map import read_boundary

    folders = {ego: options.out / Path(ego).stem for ego in specs}
    for ego, spec in specs.items():
        if not play_run(spec, folders[ego], ego, lambda _: "").finished:
            notes.print("Stopped. The same command again goes on from there.")
            return INTERRUPTED
    found = read_boundary(folders.pop(name), folders)
    write_boundary(options.out, found)
    print_answer(options, found, _boundary_table(found), *found.notes, f"Picture: {options.out / BOUNDARY_PICTURE}")
    return OK


def _fixed(text: str) -> tuple[str, float | str]:
    name, value = assignment(text)
    try:
        return name, float(value)
    except ValueError:
        return name, value


def _boundary_table(found: BoundaryMap) -> Table:
    from risk_sac.report.parameter_plots import in_words

    columns = ("driver", "points", "fails in (95 %)", "ego fails, it does not (95 %)")
    table = Table(*columns, box=SIMPLE_HEAD, padding=0)
    for told in found.maps:
        alone = "" if told.ego_fails_alone is None else in_words(told.ego_fails_alone)
        how = f"{told.name}, judged" if told.judged else told.name
        table.add_row(how, str(told.episodes), in_words(told.fails), alone)
    return table
