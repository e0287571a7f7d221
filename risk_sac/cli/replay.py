"""`risk-sac bundle`, `replay`, `verify`, `export`, `minimise`, `region` and `clusters`: plays failures again."""

import argparse
import textwrap
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

from rich.markup import escape

from risk_sac.cli.console import FAILED, OK, counted, narrow_table, print_answer, say
from risk_sac.cli.parser import WIDTH, Commands, add_command, add_failure_arguments, add_json_flag
from risk_sac.errors import ConfigError, SimulationError
from risk_sac.failures.export.formats import FORMATS, Files, FormatName, check_carries, export
from risk_sac.failures.studied import Aim, Studied, note, valid_failure
from risk_sac.host.machine import cores
from risk_sac.host.terminal import complain, console
from risk_sac.metrics import pooled_headline
from risk_sac.records import EpisodeRecord
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import RESULTS, TIMES, first_of_variants, read_results, read_verified

if TYPE_CHECKING:
    from risk_sac.failures.bundle import Bundle


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
    for folder in folders:
        runs = [folder] if (folder / RESULTS).exists() else sorted(file.parent for file in folder.glob(f"*/{RESULTS}"))
        if not runs:
            raise ConfigError(
                "BUNDLE", f"{folder}, which holds no run", "the folder of a run, or one that contains some"
            )
        yield from runs


def add_understand(commands: Commands) -> None:
    """Adds the commands."""
    minimise = add_command(
        commands,
        "minimise",
        _minimise,
        "reduce a failure to the least that still makes the ego fail",
        example="minimise runs/low 42 --out core.npz",
    )
    region = add_command(
        commands, "region", _region, "measure how many neighbours of a failure fail too", example="region runs/low 42"
    )
    for parser, metavar, out in (
        (minimise, "FILE.npz", "write the core there, as a bundle"),
        (region, "FILE.json", "write the shares there"),
    ):
        what = "a bundle, or the folder of a finished run, where the report finds the outcome"
        parser.add_argument("path", type=Path, metavar="PATH", help=what)
        parser.add_argument("failure", nargs="?", metavar="FAILURE", help="of a run: id of a failure, or its number")
        parser.group("output").add_argument("--out", type=Path, metavar=metavar, help=out)
    minimise.add_argument(
        "--aim",
        choices=get_args(Aim),
        default="smallest",
        help="smallest: the fewest and weakest actions; most-plausible: the least unlikely motion that still fails, "
        "in a bundle that keeps the recording too",
    )
    clusters = add_command(
        commands,
        "clusters",
        _clusters,
        "sort the failures of runs into kinds, with one example of each",
        example="clusters runs/low runs/mixed",
    )
    clusters.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="folder of a run, or its results.json")
    clusters.group("output").add_argument("--out", type=Path, metavar="FILE.json", help="write the kinds there")
    add_json_flag(clusters)


class _Asked(NamedTuple):
    bundle: "Bundle"
    folder: Path | None = None  # of its run; None of a bundle's
    digest: str = ""  # of the run's results


def _asked(path: Path, failure: str | None) -> _Asked:
    from risk_sac.failures.bundle import read_bundle  # here, for the simulator takes a second to load
    from risk_sac.failures.study import bundles

    if failure is None:
        if path.is_dir():
            raise ConfigError("FAILURE", f"{path}, which is a folder", "a bundle, or a failure of its run too")
        return _Asked(read_bundle(path))
    results, folder = read_results(path), path if path.is_dir() else path.parent
    if results.digest is None:
        raise ConfigError("PATH", f"the run in {folder} is not finished")
    named = results.failure(failure)
    valid_failure(named.id, named.episode)  # before it is played
    (bundle,) = bundles(folder, results, [named.episode])
    return _Asked(bundle, folder, results.digest)


def _note(asked: _Asked, studied: Studied) -> None:
    if asked.folder is not None:
        note(asked.folder, asked.digest, asked.bundle.manifest.episode.index, studied)


def _minimise(options: argparse.Namespace) -> int:
    from risk_sac.failures.bundle import write_bundle
    from risk_sac.failures.minimise import minimise

    asked = _asked(options.path, options.failure)
    if asked.folder is None and options.out is None:
        raise ConfigError("--out", "nothing", "a file for the core of a bundle")
    if options.aim == "most-plausible":
        return _more_plausible(asked.bundle, options.out)
    minimal = minimise(asked.bundle)
    core = minimal.manifest.core
    assert core is not None  # that is what `minimise` makes
    if options.out is not None:
        write_bundle(options.out, minimal)
    before, after = core.before, core.after
    lines = [
        core.sentence,
        f"adversaries that act: {after.adversaries} of {before.adversaries}",
        f"segments of 0.5 s: {after.segments} of {before.segments}; drive and steering apart: "
        f"{after.channels} of {before.channels}",
        f"parameters of the scene in the middle of their ranges: {core.plain_parameters} of {core.parameters}",
        f"copies, perturbed by 1 %, that fail as well: {core.held} of {core.copies}",
        f"played: {counted(core.episodes, 'episode')}",
    ]
    if options.out is not None:
        lines.append(f"Bundle: {options.out}")
    say("\n".join(lines))
    _note(asked, Studied(core=core))
    return OK


def _more_plausible(bundle: "Bundle", out: Path | None) -> int:
    from risk_sac.failures.bundle import write_bundle
    from risk_sac.failures.minimise import most_plausible

    likelier = most_plausible(bundle)
    motion = likelier.manifest.plausible
    assert motion is not None  # that is what `most_plausible` makes
    before, after = (_behaviour(each.manifest.episode) for each in (bundle, likelier))
    if out is not None:
        write_bundle(out, likelier)
    lines = [
        motion.sentence,
        f"recorded: {before}",
        f"most plausible: {after}",
        f"unlikeliness, -log p: {motion.before:.1f} before, {motion.after:.1f} after",
        f"copies, perturbed by 1 %, that fail as well: {motion.held} of {motion.copies}",
        f"played: {counted(motion.episodes, 'episode')}",
        *([] if out is None else [f"Bundle, with the recording: {out}"]),
    ]
    say("\n".join(lines))
    return OK


def _behaviour(episode: EpisodeRecord) -> str:
    violation = episode.worst_violation
    return "" if violation is None or violation.behaviour is None else violation.behaviour.in_words


def _region(options: argparse.Namespace) -> int:
    from risk_sac.failures.variants import region

    asked = _asked(options.path, options.failure)
    if options.out is not None:
        options.out.parent.mkdir(parents=True, exist_ok=True)  # before anything is played in vain
    failing_region = region(asked.bundle)
    title = escape(asked.bundle.manifest.id)
    table = narrow_table("changed", "fail", "of", "share", "95 % interval", title=title)
    for share in failing_region.shares:
        rate, interval = f"{share.failed / share.played:.2f}", f"{share.low:.2f} - {share.high:.2f}"
        table.add_row(share.what, str(share.failed), str(share.played), rate, interval)
    console.print(table)
    console.print("a needle: most scenes right beside it do not fail" if failing_region.needle else "no needle")
    if options.out is not None:
        replace_file(options.out, failing_region.model_dump_json(indent=2).encode())
    _note(asked, Studied(region=failing_region))
    return OK


def _failures(path: Path) -> Iterator[tuple[str, EpisodeRecord]]:
    """Yields a run's failures with ids; refuses kinds that did not repeat."""
    results = read_results(path)
    verified = read_verified(path if path.is_dir() else path.parent, results.digest or "")
    episodes = [failure.episode for failure in results.failures]
    for episode in verified.judged(episodes) if verified else episodes:
        yield episode.id_in(results.spec.id), episode


def _clusters(options: argparse.Namespace) -> int:
    from risk_sac.metrics import with_published
    from risk_sac.report.runs import overview

    summary = overview(episode for run in options.runs for episode in _failures(run))
    table = narrow_table("failures", "variants", "preventable", "kind; look first at")
    for cluster in summary.clusters:
        first = f"{cluster.name}\n  {cluster.representative} ({cluster.grade})"
        preventable = with_published(cluster.preventable, cluster.published)
        table.add_row(str(cluster.failures), str(cluster.variants), preventable, escape(first))
    kinds = f"{counted(len(summary.clusters), 'kind')}; effective number of kinds (Vendi score): {summary.vendi:.1f}"
    note = "in brackets: preventable by R157, FSM or RSS"
    covered = f"cells of the taxonomy with a contact: {summary.covered} of {summary.cells}"
    print_answer(options, summary, table, f"{kinds}\n{covered}\n{note}")
    if options.out is not None:
        replace_file(options.out, summary.model_dump_json(indent=2).encode())
    return OK
