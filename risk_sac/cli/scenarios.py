"""`risk-sac scenarios`: lists, shows, checks, imports, draws and copies scenario documents."""

import argparse
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.console import FAILED, OK, print_answer, say
from risk_sac.cli.parser import Commands, Parser, add_command, add_group, add_json_flag
from risk_sac.config import Scenario
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.host.terminal import complain, console
from risk_sac.scenario import library, reading
from risk_sac.scenario.check import check_document

if TYPE_CHECKING:
    from risk_sac.openscenario.scenario_file import Imported

OPENSCENARIO = ".xosc"
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


def kept_name(name_or_file: str) -> str:
    """Returns the name of a scenario; a document's or an OpenSCENARIO file's is put into the library first.

    Raises:
      ConfigError: the document has a fault, or there is none.
    """
    if not is_file(name_or_file):
        return name_or_file
    if is_openscenario(name_or_file):
        return _kept(_imported(Path(name_or_file)))
    try:
        document, folder = document_at(name_or_file)
        nets = reading.nets_of(document, folder)
        check_document(document, nets)
    except ConfigError as error:
        for fault in (error, *error.others):
            fault.field = f"{name_or_file}: {fault.field}".removesuffix(": ")
        raise
    return library.keep(document, library.own_files(document, nets))


def is_openscenario(file: str) -> bool:
    """Whether a file is OpenSCENARIO XML, by its ending."""
    return Path(file).suffix.lower() == OPENSCENARIO


def _imported(file: Path, ego: str | None = None) -> "Imported":
    """Imports an OpenSCENARIO file, and says what differs from it."""
    from risk_sac.openscenario.scenario_file import import_scenario  # imported here: few commands need it

    imported = import_scenario(file, ego=ego)
    origin = imported.document.origin
    for remark in origin.remarks if origin is not None else ():
        complain(f"warning: {remark}")
    return imported


def _kept(imported: "Imported") -> str:
    """Puts an imported scenario into the library, once its document is checked; returns its name."""
    with tempfile.TemporaryDirectory() as folder:
        for name, content in imported.files.items():
            Path(folder, name).write_bytes(content)
        try:
            check_document(imported.document, reading.nets_of(imported.document, Path(folder)))
        except ConfigError as error:
            raise imported.located(error) from error
    return library.keep(imported.document, imported.files)


def document_at(name_or_file: str) -> tuple[Scenario, Path | None]:
    """Returns a scenario's document, and the folder of its own nets if it has one.

    Raises:
      ConfigError: there is no such scenario or file, or the document has a fault.
    """
    if is_file(name_or_file) and is_openscenario(name_or_file):
        return library.kept(kept_name(name_or_file))
    if is_file(name_or_file):
        return reading.read_document(Path(name_or_file)), Path(name_or_file).absolute().parent
    if name_or_file in reading.shipped_names():
        return reading.shipped_document(name_or_file), None
    try:
        return library.kept(name_or_file)
    except ConfigError as error:
        known = library.listed()
        close = next((name for name in known if name.startswith(f"{name_or_file}_")), name_or_file)
        remedy = did_you_mean(close, (*reading.shipped_names(), *known)) or error.remedy
        raise ConfigError("scenario", error.got, error.expected, remedy) from None


def is_file(name_or_file: str) -> bool:
    """Whether a word names a file: it has a folder or an ending."""
    if Path(name_or_file).suffix or "/" in name_or_file:
        if not Path(name_or_file).is_file():
            remedy = "check its path, or name a scenario of `risk-sac scenarios list`"
            raise ConfigError("scenario", f"{name_or_file}, which is no file", "a document", remedy)
        return True
    return False


def _list(options: argparse.Namespace) -> int:
    documents = {name: document_at(name)[0] for name in (*reading.shipped_names(), *library.listed())}
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
    return reading.scenario_file(name).read_text() if name in reading.shipped_names() else library.written(document)


def _check(options: argparse.Namespace) -> int:
    """Fails if the ego is touched without an attack, or if nothing could be played."""
    document, folder = document_at(options.file)
    nets = reading.nets_of(document, folder)
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
    from risk_sac.failures.scenario_trial import scenario_png  # here, because loading matplotlib takes a second

    out = options.out or Path(options.file).with_suffix(".png").absolute()
    out.write_bytes(scenario_png(document, reading.nets_of(document, folder)))
    say(f"Drawn: {out}")
    return OK


def _import(options: argparse.Namespace) -> int:
    if options.out is not None and options.out.exists():
        raise ConfigError("out", f"{options.out}, which is there", "a new file", "choose another name")
    imported = _imported(options.file, options.ego_entity)
    document = imported.document
    if options.out is not None:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        for name, content in imported.files.items():
            (options.out.parent / name).write_bytes(content)
        options.out.write_text(library.written(document))
        where = f"Written: {options.out}; its roads and nets beside it."
    else:
        where = f"Kept as {_kept(imported)}."
    table = Table("", "", box=None, show_header=False)
    table.add_row("actors", ", ".join(document.actors) or "none")
    table.add_row("parameters that vary", ", ".join(axes(document)) or "none")
    table.add_row("points of the grid", str(imported.points))
    table.add_row("roads", ", ".join(reading.roads(document)))
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
    for name in (*reading.networks(document), *reading.roads(document)):
        if folder is not None and (folder / name).is_file():
            files[options.file.parent / name] = (folder / name).read_bytes()
    if not options.file.parent.is_dir():
        raise ConfigError("file", f"a folder {options.file.parent}, which is not there", "a folder", "make it first")
    for file, content in files.items():
        if file.exists() and (file == options.file or file.read_bytes() != content):
            raise ConfigError("file", f"{file}, which is there", "a new file", "choose another name or folder")
    for file, content in files.items():
        file.write_bytes(content)
    own = "its nets beside it" if folder is not None else f"its net ships: {reading.FOLDER / document.name}"
    say(f"Written: {options.file}; {own}.")
    return OK
