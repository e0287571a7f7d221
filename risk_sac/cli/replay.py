"""`risk-sac bundle` and `risk-sac replay`: a failure in one file, and played again from it."""

import argparse
from contextlib import closing
from pathlib import Path

from risk_sac.cli.console import FAILED, OK, Commands, complain, console
from risk_sac.cli.text import printable
from risk_sac.errors import ConfigError, SimulationError
from risk_sac.run_folder.results import read_results
from risk_sac.run_folder.series import read_series


def add_bundle(commands: Commands) -> None:
    """Adds the command."""
    bundle = commands.add_parser("bundle", help="write a contact into one file that stands alone")
    bundle.set_defaults(command=_bundle)
    bundle.add_argument("results", type=Path, metavar="RESULTS", help="folder of a run, or its results.json")
    bundle.add_argument("failure", metavar="FAILURE", help="id of a contact, or its number")
    bundle.add_argument("--out", type=Path, required=True, metavar="FILE", help="the bundle")


def add_replay(commands: Commands) -> None:
    """Adds the command."""
    replay = commands.add_parser("replay", help="play the failure in a bundle again")
    replay.set_defaults(command=_replay)
    replay.add_argument("bundle", type=Path, metavar="BUNDLE", help="what `risk-sac bundle` wrote")


def _bundle(options: argparse.Namespace) -> int:
    results = read_results(options.results)
    contact = results.contact(options.failure)
    folder = options.results if options.results.is_dir() else options.results.parent
    recorded = read_series(folder / contact.series)
    if "released_s" not in recorded:
        raise ConfigError(f"{folder / contact.series} is older than the release of adversaries", field="FAILURE")
    from risk_sac.env import RiskSacEnv  # here, because loading the simulator takes a second
    from risk_sac.failures.bundle import make_bundle, write_bundle
    from risk_sac.failures.replay import actions_of, replay, trajectory_digest

    with closing(RiskSacEnv.of(results.spec)) as env:
        played = replay(env, contact.episode, actions_of(recorded))
    if trajectory_digest(played.series) != trajectory_digest(recorded):
        raise SimulationError(f"{contact.id} does not repeat here, so no bundle was written")
    write_bundle(options.out, make_bundle(results.spec, contact.episode, recorded, played.signal_heads))
    console.print(f"Bundle: {options.out}")
    return OK


def _replay(options: argparse.Namespace) -> int:
    from risk_sac.env import RiskSacEnv
    from risk_sac.failures.bundle import code_digest, read_bundle, versions, world_of
    from risk_sac.failures.replay import actions_of, replay, trajectory_digest

    bundle = read_bundle(options.bundle)
    manifest = bundle.manifest
    for name, digest in world_of(manifest.spec, manifest.episode).items():
        if manifest.world.get(name) != digest:
            raise ConfigError(f"{manifest.id} was found on another {name}, so it cannot be replayed", field="BUNDLE")
    if (manifest.code, manifest.versions) != (code_digest(), versions()):
        complain(f"the code, or {' or '.join(versions())}, has changed since the bundle was written")
    with closing(RiskSacEnv.of(manifest.spec)) as env:
        played = replay(env, manifest.episode, actions_of(bundle.series))
    same = trajectory_digest(played.series) == manifest.digest
    same &= played.signal_heads.tobytes() == bundle.signal_heads.tobytes()
    found = played.collision
    struck = f"strikes {found.other_id} at {found.ego_speed_mps:.1f} m/s" if found else "touches nobody"
    outcome = "every array is as recorded" if same else "not as recorded"
    console.print(printable(f"{manifest.id}: the ego {struck}; {outcome}"), markup=False, soft_wrap=True)
    return OK if same else FAILED
