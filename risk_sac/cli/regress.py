"""`risk-sac regress`: replays failures against another ego; writes a JUnit report."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from junitparser import Error, Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite
from pydantic import ValidationError
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.console import COULD_NOT_RUN, EGO, FAILED, OK, counted, narrow_table
from risk_sac.cli.flags import named_ego
from risk_sac.cli.parser import Commands, add_command
from risk_sac.config import EgoConfig
from risk_sac.config.base import read_text
from risk_sac.egos.registry import check
from risk_sac.errors import ConfigError
from risk_sac.failures.export.formats import FORMATS, FormatName, export, names
from risk_sac.failures.studied import Case, Regression, Verdict
from risk_sac.host.terminal import console, printable
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import RESULTS, first_of_variants, read_results

if TYPE_CHECKING:
    from risk_sac.failures.bundle import Bundle
    from risk_sac.failures.regress import Regressed


def add(commands: Commands) -> None:
    """Adds the command."""
    regress = add_command(
        commands,
        "regress",
        _regress,
        "play old failures against another ego",
        more="The exit status is 1 if one of them is not fixed, and 2 if they could not be played.",
        example="regress --failures failures/ --ego careful --junit regress.xml",
    )
    regress.set_defaults(on_error=COULD_NOT_RUN)
    failures = "bundles, folders of bundles, or folders of runs; their policy acts on after the recorded actions"
    cases = regress.group("cases")
    cases.add_argument("--failures", type=Path, nargs="+", required=True, metavar="SET", help=failures)
    cases.add_argument("--ego", required=True, metavar="EGO", help=EGO)
    cases.add_argument("--baseline", type=Path, metavar="FILE.json", help="known cases, as --out wrote them")
    output = regress.group("output")
    output.add_argument("--out", type=Path, metavar="FILE.json", help="write the cases there")
    output.add_argument("--junit", type=Path, metavar="FILE.xml", help="write a JUnit report there")
    exports = "write what is neither fixed nor known there, as it happens now: bundles, and --format"
    output.add_argument("--exports", type=Path, metavar="FOLDER", help=exports)
    of_failure = [*map(str, names("failure"))]
    kinds = f"with --exports: {', '.join(of_failure)}; see `risk-sac export --help`"
    output.add_argument("--format", nargs="+", default=[], choices=of_failure, metavar="FORMAT", help=kinds)


def _regress(options: argparse.Namespace) -> int:
    ego = named_ego(options.ego)
    check(ego)  # else each case would be "not comparable"
    if options.format and options.exports is None:
        raise ConfigError("--format", "it without --exports", "both")
    for file in filter(None, (options.out, options.junit)):
        file.parent.mkdir(parents=True, exist_ok=True)  # before anything is played in vain
    baseline = read_baseline(options.baseline) if options.baseline else None
    regressed = list(_cases(options.failures, ego))
    regression = Regression(ego=ego, cases=tuple(each.case for each in regressed))
    if baseline is not None:
        regression = regression.beside(baseline)
    console.print(cases_table(regression))
    if options.out is not None:
        replace_file(options.out, regression.model_dump_json(indent=2).encode())
    if options.junit is not None:
        replace_file(options.junit, junit(regression))
    if options.exports is not None:
        bundles = [each.bundle for each, case in zip(regressed, regression.cases, strict=True) if not case.passed]
        _export(options.exports, [*map(FormatName, options.format)], bundles)
    return OK if regression.passed else FAILED


def cases_table(regression: Regression) -> Table:
    """The cases, and below them how many there are of each verdict."""
    caption = f"{counted(len(regression.cases), 'failure')}: {regression.counts_in_words}"
    table = narrow_table("verdict", "failure, and what happens now", caption=caption, caption_justify="left")
    for case in regression.cases:
        table.add_row(case.verdict_in_words, escape(f"{case.id}: {case.name}\n  {case.reason}"))
    return table


def _export(folder: Path, formats: list[FormatName], bundles: list["Bundle"]) -> None:
    from risk_sac.failures.bundle import write_bundle
    from risk_sac.failures.export.formats import write
    from risk_sac.failures.export.recorded import Recorded

    for bundle in bundles:
        stem = bundle.manifest.name
        write_bundle(folder / f"{stem}.npz", bundle)
        for name in formats:
            suffix = FORMATS[name].suffix
            out = folder / f"{stem}{f'-{name}' if suffix == '.zip' else ''}{suffix}"
            write(FORMATS[name], export(name, Recorded.of(bundle)), out)
    console.print(f"{counted(len(bundles), 'failure')} to look at: {folder}", soft_wrap=True)


def _cases(paths: list[Path], ego: EgoConfig) -> Iterator["Regressed"]:
    """Plays failures of files and runs; reads all before the first play."""
    from risk_sac.failures.bundle import read_bundle  # here, for the simulator takes a second to load
    from risk_sac.failures.regress import regress, regress_run

    files: list[Path] = []
    runs: list[Path] = []
    for path in paths:
        if path.is_dir() and (path / RESULTS).exists():
            runs.append(path)
        else:
            files += sorted(path.glob("*.npz")) if path.is_dir() else [path]
    bundles = [read_bundle(file) for file in files]
    if not bundles and not any(first_of_variants(read_results(run)) for run in runs):
        raise ConfigError("--failures", f"there is no failure in {', '.join(map(str, paths))}")
    yield from (regress(bundle, ego) for bundle in bundles)
    for run in runs:
        yield from regress_run(run, ego)


def read_baseline(file: Path, flag: str = "--baseline") -> Regression:
    """Read the cases that `--out` wrote."""
    try:
        return Regression.model_validate_json(read_text(file, flag))
    except ValidationError as error:
        raise ConfigError(flag, f"{file} was not written by `risk-sac regress`") from error


FAILS = (Verdict.STILL_FAILING, Verdict.NEW_KIND)


def junit(regression: Regression) -> bytes:
    """Returns JUnit: fixed passes, known is skipped, flaky or incomparable is error."""
    suite = TestSuite("regression")
    suite.add_property("ego", regression.ego.model_dump_json())
    suite.add_testcases([_case(case) for case in regression.cases])
    report = JUnitXml("risk-sac regress")
    report.add_testsuite(suite)
    report.update_statistics()
    text: bytes = report.tostring()
    return text


def _case(case: Case) -> TestCase:
    test_case = TestCase(printable(case.id), printable(case.name))
    if case.grade is not None:
        test_case.add_property("grade", case.grade)
    said = printable(f"{case.verdict.replace('_', ' ')}: {case.reason}")
    if case.verdict is Verdict.FIXED:
        test_case.system_out = said
    elif case.known:
        test_case.append(Skipped(f"known; {said}"))
    else:
        test_case.append((Failure if case.verdict in FAILS else Error)(said, case.verdict))
    return test_case
