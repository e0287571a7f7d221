"""`risk-sac scenarios` and `places`: handles scenario documents, lists patterns on maps."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.console import FAILED, OK, counted, print_answer, say
from risk_sac.cli.flags import MAP_HELP, document_at, imported_file, keep_imported
from risk_sac.cli.parser import Commands, Parser, add_command, add_group, add_json_flag
from risk_sac.config import Scenario
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import console
from risk_sac.maps.convert import present_net
from risk_sac.maps.finder import FINDERS, Map, survey
from risk_sac.maps.found import TITLES, Pattern, Survey
from risk_sac.run_folder.durable import scratch_folder
from risk_sac.scenario import library
from risk_sac.scenario.reading import FOLDER, nets_of, networks, roads, scenario_file, shipped_names
from risk_sac.world.net import net_remarks

if TYPE_CHECKING:
    from risk_sac.failures.trials import Tried


FILE_HELP = "a scenario document, YAML or JSON, with its nets beside it"


def add(commands: Commands) -> None:
    """Adds the commands."""
    group = add_group(
        commands,
        "scenarios",
        "list, show, check, import, draw and copy scenarios",
        example="scenarios check my_scenario.yaml",
    )
    inner = group.add_subparsers(required=True, metavar="COMMAND", parser_class=Parser)
    listing = add_command(inner, "list", _list, "list the scenarios that ship and those kept", example="scenarios list")
    add_json_flag(listing)
    showing = add_command(inner, "show", _show, "print a scenario's document", example="scenarios show low")
    showing.add_argument("name", metavar="NAME", help="of a scenario, shipped or kept")
    checking = add_command(
        inner,
        "check",
        _check,
        "check a document and play 20 scenes without an attack",
        example="scenarios check my_scenario.yaml",
    )
    checking.add_argument("file", metavar="FILE", help=f"{FILE_HELP}; or the name of a scenario")
    checking.add_argument("--out", type=Path, metavar="FILE.png", help="draw the scenario too")
    add_json_flag(checking)
    importing = add_command(
        inner,
        "import",
        _import,
        "import an OpenSCENARIO file with its roads and catalogs",
        example="scenarios import cut_in.xosc --out cut_in.yaml",
    )
    importing.add_argument("file", type=Path, metavar="FILE.xosc", help="a scenario, or a variation file that names it")
    importing.add_argument(
        "--out", type=Path, metavar="DOC.yaml", help="write the document and its roads (default: keep it by name)"
    )
    importing.add_argument(
        "--ego-entity", metavar="NAME", help="the ego (default: the entity named Ego, or the one with a controller)"
    )
    add_json_flag(importing)
    drawing = add_command(
        inner,
        "draw",
        _draw,
        "draw a scenario from above: how it begins, and where its actors may start",
        example="scenarios draw my_scenario.yaml --out my_scenario.png",
    )
    drawing.add_argument("file", metavar="FILE", help=f"{FILE_HELP}; or the name of a scenario")
    drawing.add_argument("--out", type=Path, metavar="FILE.png", help="(default: beside FILE, or NAME.png)")
    copying = add_command(
        inner, "copy", _copy, "copy a scenario to a file, to edit it", example="scenarios copy low mine.yaml"
    )
    copying.add_argument("name", metavar="NAME", help="of a scenario, shipped or kept")
    copying.add_argument("file", type=Path, metavar="FILE", help="that is written, its nets beside it")


def _list(options: argparse.Namespace) -> int:
    documents = {name: document_at(name)[0] for name in (*shipped_names(), *library.listed())}
    rows = [
        {
            "name": name,
            "summary": of.summary,
            "tags": of.tags,
            "parameters": list(of.parameters),
            "actors": list(of.actors),
        }
        for name, of in documents.items()
    ]
    table = Table("name", "actors", "summary", "tags", box=SIMPLE_HEAD)
    for row, of in zip(rows, documents.values(), strict=True):
        table.add_row(*map(escape, (str(row["name"]), ", ".join(of.actors), of.summary, " ".join(of.tags))))
    print_answer(options, rows, table)
    return OK


def _show(options: argparse.Namespace) -> int:
    console.out(_text(options.name).rstrip(), highlight=False)
    return OK


def _text(name: str) -> str:
    document, _ = document_at(name)
    return scenario_file(name).read_text() if name in shipped_names() else library.written(document)


def _check(options: argparse.Namespace) -> int:
    document, folder = document_at(options.file)
    nets = nets_of(document, folder)
    from risk_sac.failures.scenario_trial import try_document  # here, because loading the simulator takes a second

    checked = try_document(document, nets)
    table = Table("", "", box=None, show_header=False)
    refused = ", ".join(f"{count} by {rule}" for rule, count in checked.refused.items())
    table.add_row("scenes", f"{checked.scenes}, of which {checked.played} are played")
    table.add_row("refused", refused or "none")
    table.add_row("contacts without an attack", str(checked.contacts))
    table.add_row("out of reach", ", ".join(checked.out_of_reach) or "none")
    table.add_row("parameters without effect", ", ".join(checked.without_effect) or "none")
    texts = [f"- {remark}" for remark in checked.remarks] or ["Nothing is wrong."]
    if options.out is not None:
        from risk_sac.failures.scenario_trial import scenario_png

        options.out.write_bytes(scenario_png(document, nets))
        texts.append(f"Drawn: {options.out}")
    print_answer(options, checked, table, *texts)
    return FAILED if checked.contacts or not checked.played else OK


def _draw(options: argparse.Namespace) -> int:
    document, folder = document_at(options.file)
    from risk_sac.failures.scenario_trial import scenario_png

    out = options.out or Path(options.file).with_suffix(".png").absolute()
    out.write_bytes(scenario_png(document, nets_of(document, folder)))
    say(f"Drawn: {out}")
    return OK


def _import(options: argparse.Namespace) -> int:
    if options.out is not None and options.out.exists():
        raise ConfigError("out", f"{options.out}, which is there", "a new file", "choose another name")
    imported = imported_file(options.file, options.ego_entity)
    document = imported.document
    if options.out is not None:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        for name, content in imported.files.items():
            (options.out.parent / name).write_bytes(content)
        options.out.write_text(library.written(document))
        where = f"Written: {options.out}; its roads and nets beside it."
    else:
        where = f"Kept as {keep_imported(imported)}."
    table = Table("", "", box=None, show_header=False)
    table.add_row("actors", ", ".join(document.actors) or "none")
    table.add_row("parameters that vary", ", ".join(axes(document)) or "none")
    table.add_row("points of the grid", str(imported.points))
    table.add_row("roads", ", ".join(roads(document)))
    answer = {
        "where": where,
        "actors": list(document.actors),
        "parameters": axes(document),
        "points": imported.points,
        "remarks": list(document.origin.remarks) if document.origin is not None else [],
    }
    print_answer(options, answer, table, where)
    return OK


def axes(document: Scenario) -> list[str]:
    """Names of the parameters that vary."""
    return [name for name, parameter in document.parameters.items() if parameter.value is None]


def _copy(options: argparse.Namespace) -> int:
    document, folder = document_at(options.name)
    files = {options.file: _text(options.name).encode()}
    for name in (*networks(document), *roads(document)):
        if folder is not None and (folder / name).is_file():
            files[options.file.parent / name] = (folder / name).read_bytes()
    if not options.file.parent.is_dir():
        raise ConfigError("file", f"a folder {options.file.parent}, which is not there", "a folder", "make it first")
    for file, content in files.items():
        if file.exists() and (file == options.file or file.read_bytes() != content):
            raise ConfigError("file", f"{file}, which is there", "a new file", "choose another name or folder")
    for file, content in files.items():
        file.write_bytes(content)
    own = "its nets beside it" if folder is not None else f"its net ships: {FOLDER / document.name}"
    say(f"Written: {options.file}; {own}.")
    return OK


SHOWN = 20


def add_places(commands: Commands) -> None:
    """Adds the command."""
    places = add_command(
        commands,
        "places",
        _places,
        "list the places of a map where a pattern fits",
        more="With --try, also plays there.",
        example="places town.net.xml --pattern crossing --out town.png",
    )
    places.add_argument("network", type=Path, metavar="MAP", help=MAP_HELP)
    choice = places.group("choice")
    choice.add_argument("--pattern", choices=list(FINDERS), help="only this one (default: all)")
    choice.add_argument("--why", action="store_true", help="list also where they do not fit, and why")
    choice.add_argument("--all", action="store_true", help=f"list all (default: {SHOWN} of each pattern)")
    trial = places.group("trial")
    trial.add_argument("--try", dest="tries", type=int, metavar="N", help="play at N random places of each pattern")
    trial.add_argument("--episodes", type=int, default=20, metavar="N", help="of each place (default: %(default)s)")
    trial.add_argument("--seed", type=int, default=0, metavar="N", help="of the choice (default: %(default)s)")
    places.group("output").add_argument("--out", type=Path, metavar="FILE.png", help="draw the map with its places")
    add_json_flag(places)


def _places(options: argparse.Namespace) -> int:
    patterns: tuple[Pattern, ...] = (options.pattern,) if options.pattern else tuple(FINDERS)
    with scratch_folder() as folder:
        converted = present_net(options.network, folder)
        chosen = Map(converted.file)
        map_survey = survey(chosen.net, patterns)
        warnings = [*converted.warnings, *net_remarks(chosen.net)]
        if options.out is not None:
            from risk_sac.failures.from_above import map_png  # here, because loading matplotlib takes a second

            options.out.write_bytes(map_png(chosen.net, map_survey))
        if options.tries is not None:
            return _try_places(chosen, map_survey, options)
    if options.json:
        fits, misfits = [fit.told() for fit in map_survey.fits], [misfit.told() for misfit in map_survey.misfits]
        said = {"places": fits, "elsewhere": misfits, "nowhere": map_survey.nowhere, "warnings": warnings}
        console.out(json.dumps(said), highlight=False)
        return OK
    for warning in warnings:
        console.print(f"warning: {warning}", soft_wrap=True, markup=False)
    for pattern in patterns:
        _tell(pattern, map_survey, most=len(map_survey.fits) if options.all else SHOWN, why=options.why)
    if options.out is not None:
        console.print(f"Drawn: {options.out}", soft_wrap=True)
    return OK


def _tell(pattern: Pattern, map_survey: Survey, most: int, *, why: bool) -> None:
    fits = [fit for fit in map_survey.fits if fit.spot.pattern == pattern]
    misfits = [misfit for misfit in map_survey.misfits if misfit.spot.pattern == pattern]
    rare = sum(fit.rare for fit in fits)
    marked = f", contacts are rare at {rare} of them" if rare else ""
    counts = f"{counted(len(fits), 'place')}{marked}; does not fit at {len(misfits)}"
    nowhere = f": {map_survey.nowhere[pattern]}" if pattern in map_survey.nowhere else ""
    console.print(f"{TITLES[pattern]} ({pattern}): {counts}{nowhere}", highlight=False)
    if fits:
        console.print(_places_table("what", [(fit.spot.id, fit.summary) for fit in fits], most))
    if why and misfits:
        console.print(_places_table("why not", [(misfit.spot.id, misfit.why) for misfit in misfits], most))


def _places_table(heading: str, rows: Sequence[tuple[str, str]], most: int) -> Table:
    table = Table("place", heading, box=SIMPLE_HEAD)
    for row in rows[:most]:
        table.add_row(*map(escape, row))
    if len(rows) > most:
        table.add_row("…", f"and {len(rows) - most} more: --all")
    return table


def _try_places(chosen: Map, map_survey: Survey, options: argparse.Namespace) -> int:
    """Plays at some places and prints a row per pattern.

    Fails if a place does not run, or if the ego is touched without an attack.
    """
    from risk_sac.failures.trials import sample, try_out

    tried = []
    for fit in sample(map_survey.fits, options.tries, options.seed):
        tried.append(try_out(fit, chosen.keep(fit), options.episodes, options.seed))
        for why in _wrong(tried[-1]):
            console.print(f"{fit.spot.pattern} at {fit.spot.id}: {why}", markup=False, soft_wrap=True)
    console.print(_tried(map_survey, tried))
    return FAILED if any(not each.runs or each.touched_unattacked for each in tried) else OK


def _wrong(tried: "Tried") -> list[str]:
    whys = list(dict.fromkeys(tried.invalid))
    if not tried.played and not tried.invalid:
        whys.append(f"all scenes are refused: {dict(tried.rejected)}")
    if tried.touched_unattacked:
        whys.append(f"{tried.touched_unattacked} contacts without an attack")
    if tried.unlike is not None:
        whys.append(tried.unlike)
    return whys


def _tried(map_survey: Survey, tried: Sequence["Tried"]) -> Table:
    names = ("pattern", "places", "tried", "run", "played", "refused", "invalid", "touched, unattacked", "mirrored")
    table = Table(*names, box=SIMPLE_HEAD)
    for pattern in dict.fromkeys(each.fit.spot.pattern for each in tried):
        own = [each for each in tried if each.fit.spot.pattern == pattern]
        row = (
            map_survey.counts[pattern],
            len(own),
            sum(each.runs for each in own),
            sum(each.played for each in own),
            sum(each.rejected.total() for each in own),
            sum(len(each.invalid) for each in own),
            sum(each.touched_unattacked for each in own),
            sum(each.unlike is None for each in own),
        )
        table.add_row(escape(pattern), *map(str, row))
    return table
