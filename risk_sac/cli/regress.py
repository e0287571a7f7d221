"""`risk-sac regress`: old failures against another ego."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError
from rich.box import SIMPLE_HEAD
from rich.table import Table

from risk_sac.cli.console import FAILED, OK, Commands, console
from risk_sac.cli.text import counted, printable
from risk_sac.config.spec_file import read_ego
from risk_sac.errors import ConfigError
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import RESULTS, read_results
from risk_sac.run_folder.verified import distinct_failures

if TYPE_CHECKING:
    from risk_sac.failures.bundle import Bundle
    from risk_sac.failures.play import Policy
    from risk_sac.failures.regress import Regression


def add_regress(commands: Commands) -> None:
    """Adds the command."""
    regress = commands.add_parser(
        "regress", help="play old failures against another ego; exit status 1 if one is not fixed"
    )
    regress.set_defaults(command=_regress)
    regress.add_argument(
        "--failures",
        type=Path,
        nargs="+",
        required=True,
        metavar="SET",
        help="bundles, folders of bundles, or folders of runs, whose policy acts on after the recorded actions",
    )
    ego = "default, perfect, careful, or a YAML file with the fields of a campaign's ego"
    regress.add_argument("--ego", required=True, metavar="EGO", help=ego)
    regress.add_argument("--baseline", type=Path, metavar="FILE.json", help="known cases, as --out wrote them")
    regress.add_argument("--out", type=Path, metavar="FILE.json", help="write the cases there")
    regress.add_argument("--junit", type=Path, metavar="FILE.xml", help="write a JUnit report there")


def _regress(options: argparse.Namespace) -> int:
    ego = read_ego(options.ego)
    from risk_sac.failures.regress import Regression, regress  # here, for the simulator takes a second to load
    from risk_sac.failures.regress_junit import junit

    baseline = _read_baseline(options.baseline) if options.baseline else None
    cases = tuple(regress(bundle, ego, policy) for bundle, policy in _failures(options.failures))
    found = Regression(ego=ego, cases=cases)
    if baseline is not None:
        found = found.beside(baseline)
    table = Table(box=SIMPLE_HEAD, padding=0)
    for name in ("verdict", "failure, and what happens now"):
        table.add_column(name, no_wrap=name == "verdict")
    for case in found.cases:
        verdict = f"{case.verdict.replace('_', ' ')}{', known' if case.known else ''}"
        table.add_row(verdict, printable(f"{case.id}: {case.name}\n  {case.reason}"))
    console.print(table)
    counts = {verdict: sum(case.verdict is verdict for case in found.cases) for verdict in _order(found)}
    said = ", ".join(f"{count} {verdict.replace('_', ' ')}" for verdict, count in counts.items())
    console.print(f"{counted(len(found.cases), 'failure')}: {said}", soft_wrap=True)
    if options.out is not None:
        replace_file(options.out, found.model_dump_json(indent=2).encode())
    if options.junit is not None:
        replace_file(options.junit, junit(found))
    return OK if found.passed else FAILED


def _order(found: "Regression") -> dict[str, None]:
    return dict.fromkeys(sorted(case.verdict for case in found.cases))


def _failures(paths: list[Path]) -> "Iterator[tuple[Bundle, Policy | None]]":
    """All of a set, read before the first is played, so that nothing is half done."""
    from risk_sac.failures.bundle import read_bundle
    from risk_sac.failures.collect import bundles, policy_of

    files: list[Path] = []
    runs: list[Path] = []
    for path in paths:
        if path.is_dir() and (path / RESULTS).exists():
            runs.append(path)
        else:
            files += sorted(path.glob("*.npz")) if path.is_dir() else [path]
    found = [read_bundle(file) for file in files]
    results = {run: read_results(run) for run in runs}
    if not found and not any(distinct_failures(each) for each in results.values()):
        raise ConfigError(f"there is no failure in {', '.join(map(str, paths))}", field="--failures")
    yield from ((bundle, None) for bundle in found)
    for run, each in results.items():
        policy = policy_of(run)
        yield from ((bundle, policy) for bundle in bundles(run, each, distinct_failures(each)))


def _read_baseline(file: Path) -> "Regression":
    from risk_sac.failures.regress import Regression

    try:
        return Regression.model_validate_json(file.read_bytes())
    except FileNotFoundError as error:
        raise ConfigError(f"there is no {file}", field="--baseline") from error
    except ValidationError as error:
        raise ConfigError(f"{file} was not written by `risk-sac regress`", field="--baseline") from error
