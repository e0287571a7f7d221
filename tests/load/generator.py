"""`python -m tests.load.generator --port PORT CAMPAIGN...`: pollers and event streams, from a process of their own.

It talks to this machine alone, and ends by itself. What it saw goes to standard output as JSON.
"""

import argparse
import asyncio
import contextlib
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from tests.load.followers import Follower, follow
from tests.load.pollers import PERIOD_S, Poller, Polls, poll
from tests.load.wire import Polling, get

MOST_POLLERS, MOST_STREAMS, LONGEST_S = 1000, 500, 3600.0
# What clients ask for, and how many of ten do.
KINDS = {"status": 6, "results": 2, "list": 2}
CONDITIONAL = 0.8  # of them say what they have already
MOMENTS = 50  # of a second at which clients ask, several at once, so that this process wakes only so often
CATCH_UP_S = 10.0  # for streams, at the end, to tell what had happened by then


@dataclass(frozen=True, kw_only=True)
class Load:
    """How much of it."""

    port: int
    campaigns: tuple[str, ...]
    pollers: int = 200
    streams: int = 50
    seconds: float = 20.0
    stays_s: float = 60.0  # mean time for which a stream keeps its connection
    seed: int = 0


async def generate(load: Load, followers: list[Follower]) -> Polls:
    """Poll and follow for a while; the followers know afterwards what they were told."""
    chance = Random(load.seed)
    polls = Polls()
    async with asyncio.TaskGroup() as group:
        following = [
            group.create_task(follow(follower, load.port, load.stays_s, Random(chance.random())))
            for follower in followers
        ]
        begin = asyncio.get_running_loop().time() + 0.1
        end = begin + load.seconds
        polling = [group.create_task(poll(each, load.port, begin, end, polls)) for each in pollers(load, chance)]
        await asyncio.wait(polling) if polling else await asyncio.sleep(load.seconds)
        await _catch_up(load, followers)
        for task in following:
            task.cancel()
    return polls


def pollers(load: Load, chance: Random) -> list[Poller]:
    """All of them, spread over the moments of a second, in no order."""
    kinds = [kind for kind, share in KINDS.items() for _ in range(share)]
    offsets = [PERIOD_S * (MOMENTS * number // load.pollers) / MOMENTS for number in range(load.pollers)]
    chance.shuffle(offsets)
    return [
        Poller(
            kind=kinds[number % len(kinds)],
            path=_path(kinds[number % len(kinds)], load.campaigns[number // len(kinds) % len(load.campaigns)]),
            offset_s=offset,
            conditional=chance.random() < CONDITIONAL,
        )
        for number, offset in enumerate(offsets)
    ]


def _path(kind: str, campaign: str) -> str:
    return {
        "status": f"/v1/campaigns/{campaign}",
        "results": f"/v1/campaigns/{campaign}/results",
        "list": "/v1/campaigns",
    }[kind]


async def _catch_up(load: Load, followers: Sequence[Follower]) -> None:
    """Wait until all streams have told what is stored now."""
    stored = {campaign: await _episodes_done(load.port, campaign) for campaign in load.campaigns}
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(CATCH_UP_S):
            while any(each.episodes < stored[each.campaign] for each in followers):
                await asyncio.sleep(0.05)
    for each in followers:
        lacking = stored[each.campaign] - each.episodes
        if lacking > 0:
            each.errors[f"{lacking} episodes not told after {CATCH_UP_S:g} s"] += 1


async def _episodes_done(port: int, campaign: str) -> int:
    connection = await Polling.open(port)
    try:
        answer = await connection.ask(get(port, f"/v1/campaigns/{campaign}"))
    finally:
        connection.close()
    return int(json.loads(answer.body)["progress"]["episodes_done"])


def main(arguments: Sequence[str] | None = None) -> int:
    """Generate load; returns the exit status: 1 after an error or a broken stream."""
    options = _parser().parse_args(arguments)
    load = Load(
        port=options.port,
        campaigns=tuple(options.campaigns),
        pollers=min(options.pollers, MOST_POLLERS),
        streams=min(options.streams, MOST_STREAMS),
        seconds=min(options.seconds, LONGEST_S),
        stays_s=options.stays,
        seed=options.seed,
    )
    # Clients elsewhere would push no worker off its core whenever they wake, nor empty its caches.
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    followers = _followers(load, options.go_on)
    polls = asyncio.run(generate(load, followers))
    if options.go_on is not None:
        options.go_on.write_text(json.dumps([each.state() for each in followers]))
    seen = report(load, polls, followers)
    json.dump(seen, sys.stdout)
    return 1 if seen["errors"] or seen["repeated"] or seen["missing"] else 0


def report(load: Load, polls: Polls, followers: Sequence[Follower]) -> dict[str, Any]:
    """What was seen, as JSON."""
    errors = Counter(polls.errors)
    for each in followers:
        errors.update({f"stream: {what}": count for what, count in each.errors.items()})
    return {
        "seconds": load.seconds,
        "latencies_ms": {kind: [round(each, 3) for each in seen] for kind, seen in polls.latencies_ms.items()},
        "answers": polls.answers,
        "errors": errors,
        "episodes": sum(each.episodes for each in followers),
        "repeated": sum(each.repeated for each in followers),
        "missing": sum(each.missing for each in followers),
        "connections": sum(each.connections for each in followers),
        "processor_s": time.process_time(),
    }


def _followers(load: Load, go_on: Path | None) -> list[Follower]:
    if go_on is not None and go_on.exists():
        return [Follower.restored(state) for state in json.loads(go_on.read_text())]
    return [Follower(load.campaigns[number % len(load.campaigns)]) for number in range(load.streams)]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.load.generator", description=__doc__)
    parser.add_argument("campaigns", nargs="+", metavar="CAMPAIGN", help="ids of campaigns to look at")
    parser.add_argument("--port", type=int, required=True, help="of the service, on 127.0.0.1")
    parser.add_argument("--pollers", type=int, default=Load.pollers, help="clients that ask every second")
    parser.add_argument("--streams", type=int, default=Load.streams, help="clients that follow events")
    parser.add_argument("--seconds", type=float, default=Load.seconds, help="how long")
    parser.add_argument("--stays", type=float, default=Load.stays_s, help="how long a stream keeps its connection, s")
    parser.add_argument("--seed", type=int, default=Load.seed, help="of who asks when, and breaks off when")
    parser.add_argument("--go-on", type=Path, help="file that tells streams of the next call where these ended")
    return parser


if __name__ == "__main__":
    sys.exit(main())
