"""`risk-sac bundle`, `replay`, `verify`, `export` and `regress`: writes failures into files and plays them again."""

import argparse
import textwrap
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from junitparser import Error, Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite
from pydantic import ValidationError
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.console import COULD_NOT_RUN, EGO, FAILED, OK, counted, narrow_table, print_answer, say
from risk_sac.cli.flags import named_ego
from risk_sac.cli.parser import WIDTH, Commands, add_command, add_failure_arguments, add_json_flag
from risk_sac.config import EgoConfig
from risk_sac.config.base import read_text
from risk_sac.egos.registry import check
from risk_sac.errors import ConfigError, SimulationError
from risk_sac.failures.export.formats import FORMATS, Files, FormatName, check_carries, export, names
from risk_sac.failures.studied import Case, Regression, Verdict
from risk_sac.host.machine import cores
from risk_sac.host.terminal import complain, console, printable
from risk_sac.metrics import pooled_headline
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import RESULTS, TIMES, first_of_variants, read_results


def add(commands: Commands) -> None:
    """Adds the commands."""
    bundle = add_command(
        commands,
        "bundle",
        _bundle,
        "write failures into files that can be replayed without their run",
        example="bundle runs/low 42 --out failure.npz",
    )
    add_failure_arguments(bundle, "default: every distinct one")
    out = "the bundle; of every distinct failure: the folder for them"
    bundle.group("output").add_argument("--out", type=Path, required=True, metavar="PATH", help=out)

    replay = add_command(
        commands,
        "replay",
        _replay,
        "play the failure in a bundle again and compare it bit by bit",
        example="replay failure.npz",
    )
    replay.add_argument("bundle", type=Path, metavar="BUNDLE", help="file that `risk-sac bundle` wrote")

    verify = add_command(
        commands,
        "verify",
        _verify,
        "replay the first failures of each variant in fresh processes",
        more="Only failures that repeat count as headline failures.",
        example="verify runs/low --times 3",
    )
    verify.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="folder of a finished run")
    times = f"replays of each failure (default: {TIMES})"
    verify.group("replays").add_argument("--times", type=int, default=TIMES, metavar="N", help=times)
    add_json_flag(verify)


def _bundle(options: argparse.Namespace) -> int:
    results = read_results(options.results)
    folder = options.results if options.results.is_dir() else options.results.parent
    one = None if options.failure is None else results.failure(options.failure).episode
    if one is not None and options.out.is_dir():
        raise ConfigError("--out", f"{options.out}, a folder", "the file for one bundle, such as failure.npz")
    from risk_sac.failures.bundle import write_bundle  # here, because loading the simulator takes a second
    from risk_sac.failures.study import bundles

    if one is not None:
        write_bundle(options.out, next(bundles(folder, results, [one])))
        console.print(f"Bundle: {options.out}", soft_wrap=True)
        return OK
    episodes = first_of_variants(results)
    for bundle in bundles(folder, results, episodes):
        write_bundle(options.out / f"{bundle.manifest.name}.npz", bundle)
    console.print(f"{counted(len(episodes), 'bundle')}: {options.out}", soft_wrap=True)
    return OK


def _replay(options: argparse.Namespace) -> int:
    from risk_sac.env.env import RiskSacEnv
    from risk_sac.failures.bundle import check_world, code_digest, read_bundle, versions
    from risk_sac.failures.play import replay
    from risk_sac.failures.recording import trajectory_digest

    bundle = read_bundle(options.bundle)
    manifest = bundle.manifest
    check_world(manifest)
    if (manifest.code, manifest.versions) != (code_digest(), versions()):
        complain(f"the code, or {' or '.join(versions())}, has changed since the bundle was written")
    with closing(RiskSacEnv.of(manifest.spec)) as env:
        played = replay(env, manifest.episode, bundle.series)
    same = trajectory_digest(played.series) == manifest.digest
    same &= played.signal_heads.tobytes() == bundle.signal_heads.tobytes()
    events = ", ".join(each.event for each in played.found) or "keeps every requirement that counts"
    outcome = "every array is as recorded" if same else "not as recorded"
    say(f"{manifest.id}: the ego {events}; {outcome}")
    return OK if same else FAILED


def _verify(options: argparse.Namespace) -> int:
    from risk_sac.execution.evaluate import verify

    for folder in options.runs:
        read_results(folder)  # refuses what is no run before anything is played
    outcomes = verify(options.runs, options.times, cores())
    if missing := [folder for folder in options.runs if folder not in outcomes]:
        raise SimulationError(f"{missing[0]} was not verified: its run is unfinished, or cannot be replayed")
    answer: list[dict[str, Any]] = []
    lines = []
    for folder, verified in outcomes.items():
        results = read_results(folder)
        headline = pooled_headline(each for each in (results.metrics, results.evaluation) if each is not None) or 0
        answer.append({"id": results.spec.id, "headline": headline, "episodes": verified.episodes})
        repeated = len(verified.episodes) - len(verified.flaky)
        repeat = f"{repeated} of {counted(len(verified.episodes), 'failure')} repeat"
        lines.append(f"{results.spec.id}: {counted(headline, 'headline failure')}; {repeat}")
        for index in sorted(verified.flaky):
            repetition = verified.episodes[index]
            lines.append(f"  flaky: episode {index}, {repetition.same} of {repetition.times} times the same")
    print_answer(options, answer, "\n".join(lines))
    return FAILED if any(verified.flaky for verified in outcomes.values()) else OK


def add_export(commands: Commands) -> None:
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
    from risk_sac.failures.export.formats import write

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
        runs = [folder] if (folder / RESULTS).exists() else sorted(file.parent for file in folder.glob(f"*/{RESULTS}"))
        if not runs:
            raise ConfigError(
                "BUNDLE", f"{folder}, which holds no run", "the folder of a run, or one that contains some"
            )
        yield from runs


if TYPE_CHECKING:
    from risk_sac.failures.bundle import Bundle
    from risk_sac.failures.regress import Regressed


def add_regress(commands: Commands) -> None:
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
        _export_bundles(options.exports, [*map(FormatName, options.format)], bundles)
    return OK if regression.passed else FAILED


def cases_table(regression: Regression) -> Table:
    """The cases, and below them how many there are of each verdict."""
    caption = f"{counted(len(regression.cases), 'failure')}: {regression.counts_in_words}"
    table = narrow_table("verdict", "failure, and what happens now", caption=caption, caption_justify="left")
    for case in regression.cases:
        table.add_row(case.verdict_in_words, escape(f"{case.id}: {case.name}\n  {case.reason}"))
    return table


def _export_bundles(folder: Path, formats: list[FormatName], bundles: list["Bundle"]) -> None:
    """Bundles, and beside each the formats."""
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
    """Plays the failures of files and runs; reads all of them before it plays the first."""
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
    """The report: fixed passes, known is skipped; what is flaky or cannot be compared is an error."""
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
