"""`python -m tests.load.run`: measure on this machine what the service promises under load.

Takes about half an hour, and wants a machine with nothing else to do. Shorter trials are noisier.
"""

import argparse
import json
import signal
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console

from tests.load import campaigns, database, judge
from tests.load.verdicts import Verdict, show


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and tell; returns the exit status: 1 if a promise was broken."""
    options = _parser().parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("told to stop"))  # and so stops the service, too
    console, told = Console(), {}
    if options.only != "database":
        trial = campaigns.Trial(
            seconds=options.seconds,
            phase_s=options.phase,
            warm_up_s=options.warm_up,
            pollers=options.pollers,
            streams=options.streams,
        )
        title = f"{trial.pollers} pollers and {trial.streams} event streams beside {campaigns.CAMPAIGNS} campaigns"
        told[title] = judge.judge(campaigns.measure(trial, console.log))
        show(title, told[title], console)
    if options.only != "campaigns":
        title = f"{options.campaigns:,} stored campaigns with {options.episodes:,} episodes"
        console.log(f"{title}: being written")
        told[title] = database.judge(database.measure(options.campaigns, options.episodes))
        show(title, told[title], console)
    _write(options.out, told)
    console.print(f"results: {options.out}")
    return int(any(verdict.kept is False for verdicts in told.values() for verdict in verdicts))


def _write(path: Path, told: dict[str, list[Verdict]]) -> None:
    found: dict[str, Any] = {title: [asdict(verdict) for verdict in verdicts] for title, verdicts in told.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.load.run", description=__doc__)
    usual = campaigns.Trial()
    parser.add_argument("--only", choices=["campaigns", "database"], help="one of the two parts")
    parser.add_argument("--seconds", type=float, default=usual.seconds, help="with load; as many pass without")
    parser.add_argument("--phase", type=float, default=usual.phase_s, help="seconds between load and no load")
    parser.add_argument("--warm-up", type=float, default=usual.warm_up_s, help="seconds before anything is measured")
    parser.add_argument("--pollers", type=int, default=usual.pollers, help="clients that ask every second")
    parser.add_argument("--streams", type=int, default=usual.streams, help="clients that follow events")
    parser.add_argument("--campaigns", type=int, default=10_000, help="in the database")
    parser.add_argument("--episodes", type=int, default=1_000_000, help="in the database")
    parser.add_argument("--out", type=Path, default=Path("results/load.json"), help="where the figures go")
    return parser


if __name__ == "__main__":
    sys.exit(main())
