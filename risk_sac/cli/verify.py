"""`risk-sac verify`: whether the failures of runs repeat."""

import argparse
import os
from pathlib import Path

from risk_sac.cli.console import FAILED, OK, Commands, console
from risk_sac.cli.text import counted
from risk_sac.errors import SimulationError
from risk_sac.run_folder.results import read_results
from risk_sac.run_folder.verified import TIMES


def add_verify(commands: Commands) -> None:
    """Adds the command."""
    verify = commands.add_parser("verify", help="replay the distinct failures of runs in fresh processes")
    verify.set_defaults(command=_verify)
    verify.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="folder of a finished run")
    times = f"how often each is replayed (default: {TIMES})"
    verify.add_argument("--times", type=int, default=TIMES, metavar="N", help=times)


def _verify(options: argparse.Namespace) -> int:
    from risk_sac.execution.verify import verify

    specs = {folder: read_results(folder).spec for folder in options.runs}
    found = verify(options.runs, options.times, os.cpu_count() or 1)
    if missing := [folder for folder in specs if folder not in found]:
        raise SimulationError(f"{missing[0]} was not verified: its run is unfinished, or cannot be replayed")
    for folder, verified in found.items():
        repeated = len(verified.episodes) - len(verified.flaky)
        console.print(f"{specs[folder].id}: {repeated} of {counted(len(verified.episodes), 'distinct failure')} repeat")
        for index in sorted(verified.flaky):
            repetition = verified.episodes[index]
            console.print(f"  flaky: episode {index}, {repetition.same} of {repetition.times} times the same")
    return FAILED if any(verified.flaky for verified in found.values()) else OK
