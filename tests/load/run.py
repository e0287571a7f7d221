"""`python -m tests.load.run`: measures here what the service promises under load.

Takes about half an hour, and wants a machine with nothing else to do. Shorter trials are noisier.
"""

import argparse
import json
import signal
import sys
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from tests.load import campaigns, database, large
from tests.load.promises import Promise, show


def main() -> int:
    """Measure and print; returns 1 if a promise was broken."""
    parser = argparse.ArgumentParser(prog="python -m tests.load.run", description=__doc__)
    parser.add_argument("--only", choices=["campaigns", "database", "large"], help="one of the parts")
    parser.add_argument("--seconds", type=float, default=600.0, help="with load; as many pass without")
    parser.add_argument("--phase", type=float, default=30.0, help="seconds between load and no load")
    parser.add_argument("--warm-up", type=float, default=120.0, help="seconds before anything is measured")
    parser.add_argument("--pollers", type=int, default=200, help="clients that ask every second")
    parser.add_argument("--streams", type=int, default=50, help="clients that follow events")
    parser.add_argument("--campaigns", type=int, default=10_000, help="in the database")
    parser.add_argument("--episodes", type=int, default=1_000_000, help="in the database")
    parser.add_argument("--large", type=int, default=100_000, help="episodes of one campaign")
    parser.add_argument("--out", type=Path, default=Path("results/load.json"), help="where the figures go")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("told to stop"))  # and so stops the service, too
    console, told = Console(), dict[str, list[Promise]]()
    if options.only in (None, "campaigns"):
        title = f"{options.pollers} pollers and {options.streams} event streams beside {campaigns.CAMPAIGNS} campaigns"
        load = options.seconds, options.phase, options.warm_up, options.pollers, options.streams
        told[title] = list(campaigns.judge(campaigns.measure(*load)))
        show(title, told[title], console)
    if options.only in (None, "database"):
        title = f"{options.campaigns:,} stored campaigns with {options.episodes:,} episodes"
        console.log(f"{title}: being written")
        told[title] = list(database.judge(database.measure(options.campaigns, options.episodes)))
        show(title, told[title], console)
    if options.only in (None, "large"):
        title = f"one campaign of {options.large:,} episodes"
        told[title] = list(large.judge(large.measure(options.large)))
        show(title, told[title], console)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    found = {title: [asdict(promise) for promise in promises] for title, promises in told.items()}
    options.out.write_text(json.dumps(found, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    console.print(f"results: {options.out}")
    return int(any(promise.kept is False for promises in told.values() for promise in promises))


if __name__ == "__main__":
    sys.exit(main())
