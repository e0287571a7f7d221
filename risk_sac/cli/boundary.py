"""`risk-sac boundary`: where an ego goes from passing to failing, beside other drivers."""

import argparse
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from risk_sac.cli.console import EGO, INTERRUPTED, OK, print_answer, progress_bar, say_adjustments
from risk_sac.cli.flags import add_scene_flags, assignment, named_ego, scene_flags
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.cli.scenarios import kept_name
from risk_sac.config.spec_file import read_spec
from risk_sac.env.problem import adjustments
from risk_sac.host.terminal import notes
from risk_sac.records.boundary import BoundaryMap
from risk_sac.run_folder.results import BOUNDARY_PICTURE

EPISODES = 40  # for each parameter; choice


def add(commands: Commands) -> None:
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
    search.add_argument("--episodes", type=int, metavar="N", help=f"for each ego (default: {EPISODES} per parameter)")
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
        "episodes": options.episodes or EPISODES * len(options.over),
        "boundary": asked,
        **scene_flags(options),
    }
    name = options.ego or "default"
    egos = {name: fields} | {
        other: fields | {"ego": named_ego(other).model_dump(mode="json")} for other in options.beside
    }
    specs = {ego: read_spec(None, own) for ego, own in egos.items()}
    say_adjustments(adjustments(specs[name]))
    from risk_sac.execution.evaluate import run  # here, because loading torch takes seconds
    from risk_sac.report.parameter_plots import write_boundary
    from risk_sac.search.boundary_map import read_boundary

    folders = {ego: options.out / Path(ego).stem for ego in specs}
    for ego, spec in specs.items():
        with progress_bar() as bar:
            task = bar.add_task(ego, total=spec.budget.episodes, found="")
            results = run(spec, folders[ego], lambda done, _: bar.update(task, completed=done))  # noqa: B023
        if not results.finished:
            notes.print("Stopped. The same command again goes on from there.")
            return INTERRUPTED
    found = read_boundary(folders.pop(name), folders)
    write_boundary(options.out, found)
    print_answer(options, found, _table(found), *found.notes, f"Picture: {options.out / BOUNDARY_PICTURE}")
    return OK


def _fixed(text: str) -> tuple[str, float | str]:
    name, value = assignment(text)
    try:
        return name, float(value)
    except ValueError:
        return name, value


def _table(found: BoundaryMap) -> Table:
    from risk_sac.report.parameter_plots import in_words

    table = Table(box=SIMPLE_HEAD, padding=0)
    for column in ("driver", "points", "fails in (95 %)", "ego fails, it does not (95 %)"):
        table.add_column(column)
    for told in found.maps:
        alone = "" if told.ego_fails_alone is None else in_words(told.ego_fails_alone)
        how = f"{told.name}, judged" if told.judged else told.name
        table.add_row(how, str(told.episodes), in_words(told.fails), alone)
    return table
