"""`risk-sac minimise`, `region` and `clusters`: reduces, perturbs and sorts failures."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, get_args

from rich.markup import escape

from risk_sac.cli.console import OK, counted, narrow_table, print_answer, say
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.errors import ConfigError
from risk_sac.failures.studied import Aim, Studied, note, valid_failure
from risk_sac.host.terminal import console
from risk_sac.records import EpisodeRecord
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import read_results, read_verified

if TYPE_CHECKING:
    from risk_sac.failures.bundle import Bundle


def add(commands: Commands) -> None:
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
    """The failure that the command line names."""

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
    """Leaves beside the results of a run what was found out."""
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
    """The failures of a run with their ids; flaky ones and their like are refused."""
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
