"""`risk-sac export`: writes a failure, or the episodes of runs, for other tools."""

import argparse
import textwrap
from collections.abc import Iterator
from pathlib import Path

from risk_sac.cli.console import OK
from risk_sac.cli.parser import WIDTH, Commands, add_command
from risk_sac.errors import ConfigError
from risk_sac.failures.export.formats import FORMATS, Files, FormatName, check_carries, export
from risk_sac.run_folder.results import RESULTS
from risk_sac.terminal import console


def add(commands: Commands) -> None:
    """Adds the command."""
    formats = "\n".join(
        textwrap.fill(f"  {name:13}{format_.what}", WIDTH, subsequent_indent=" " * 15)
        for name, format_ in FORMATS.items()
    )
    parser = add_command(
        commands,
        "export",
        _export,
        "write a failure in a format that other tools read",
        example="export failure.npz --format openscenario --out failure.xosc",
        epilog=f"formats:\n{formats}",
    )
    source = "the bundle of a failure; for parquet: folders of runs, or folders that contain some"
    parser.add_argument("source", type=Path, nargs="+", metavar="BUNDLE", help=source)
    output = parser.group("output")
    output.add_argument("--format", required=True, choices=[*map(str, FormatName)], metavar="FORMAT", help="see below")
    out = "the file; where a format is several files, a new folder, or a name that ends in .zip"
    output.add_argument("--out", type=Path, required=True, metavar="PATH", help=out)


def _export(options: argparse.Namespace) -> int:
    name = FormatName(options.format)
    format_ = FORMATS[name]
    check_carries(name, format_.of)  # before anything is read
    if format_.of == "episodes":
        files = export(name, list(_runs(options.source)))
    else:
        if len(options.source) > 1:
            raise ConfigError("BUNDLE", f"{len(options.source)} bundles", f"one, since {name} holds one failure")
        files = _failure(name, options.source[0])
    from risk_sac.failures.export.written import write

    write(format_, files, options.out)
    console.print(f"{format_.title}: {options.out}", soft_wrap=True)
    return OK


def _failure(name: FormatName, bundle: Path) -> Files:
    from risk_sac.failures.bundle import read_bundle  # here, because loading the simulator takes a second
    from risk_sac.failures.export.recorded import Recorded

    if bundle.is_dir():
        expected = f"the bundle of a failure, since {name} holds one"
        raise ConfigError("BUNDLE", f"{bundle}, which is a folder", expected, "`risk-sac bundle RUN FAILURE` makes it")
    return export(name, Recorded.of(read_bundle(bundle)))


def _runs(folders: list[Path]) -> Iterator[Path]:
    """Finds the folders of runs among the given ones and directly below them."""
    for folder in folders:
        found = [folder] if (folder / RESULTS).exists() else sorted(file.parent for file in folder.glob(f"*/{RESULTS}"))
        if not found:
            raise ConfigError(
                "BUNDLE", f"{folder}, which holds no run", "the folder of a run, or one that contains some"
            )
        yield from found
