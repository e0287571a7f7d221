"""`risk-sac bundle`, `replay` and `verify`: writes failures into files and plays them again."""

import argparse
from contextlib import closing
from pathlib import Path
from typing import Any

from risk_sac.cli.console import FAILED, OK, counted, print_answer, say
from risk_sac.cli.parser import Commands, add_command, add_failure_arguments, add_json_flag
from risk_sac.errors import ConfigError, SimulationError
from risk_sac.machine import cores
from risk_sac.metrics import pooled_headline
from risk_sac.run_folder.results import read_results
from risk_sac.run_folder.verified import TIMES, distinct_failures
from risk_sac.terminal import complain, console


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
        "replay the distinct failures of runs in fresh processes",
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
    from risk_sac.failures.collect import bundles

    if one is not None:
        write_bundle(options.out, next(bundles(folder, results, [one])))
        console.print(f"Bundle: {options.out}", soft_wrap=True)
        return OK
    episodes = distinct_failures(results)
    for bundle in bundles(folder, results, episodes):
        write_bundle(options.out / f"{bundle.manifest.name}.npz", bundle)
    console.print(f"{counted(len(episodes), 'bundle')}: {options.out}", soft_wrap=True)
    return OK


def _replay(options: argparse.Namespace) -> int:
    from risk_sac.env import RiskSacEnv
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
    from risk_sac.execution.verify import verify

    for folder in options.runs:
        read_results(folder)  # refuses what is no run before anything is played
    found = verify(options.runs, options.times, cores())
    if missing := [folder for folder in options.runs if folder not in found]:
        raise SimulationError(f"{missing[0]} was not verified: its run is unfinished, or cannot be replayed")
    answer: list[dict[str, Any]] = []
    lines = []
    for folder, verified in found.items():
        results = read_results(folder)
        headline = pooled_headline(each for each in (results.metrics, results.evaluation) if each is not None) or 0
        answer.append({"id": results.spec.id, "headline": headline, "episodes": verified.episodes})
        repeated = len(verified.episodes) - len(verified.flaky)
        repeat = f"{repeated} of {counted(len(verified.episodes), 'distinct failure')} repeat"
        lines.append(f"{results.spec.id}: {counted(headline, 'headline failure')}; {repeat}")
        for index in sorted(verified.flaky):
            repetition = verified.episodes[index]
            lines.append(f"  flaky: episode {index}, {repetition.same} of {repetition.times} times the same")
    print_answer(options, answer, "\n".join(lines))
    return FAILED if any(verified.flaky for verified in found.values()) else OK
