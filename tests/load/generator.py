"""`python -m tests.load.generator --port PORT CAMPAIGN...`: pollers and event streams.

It speaks just enough HTTP/1.1 itself: a client library costs several times what the service spends on an answer.
It prints what it saw as JSON.
"""

import argparse
import asyncio
import contextlib
import json
import os
import re
import sys
from collections import Counter, defaultdict
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from random import Random

HOST, PERIOD_S, PATIENCE_S = "127.0.0.1", 1.0, 10.0
KINDS = ["status"] * 6 + ["results"] * 2 + ["list"] * 2  # of ten pollers
CONDITIONAL = 0.8  # of the pollers send the ETag that they have
MOMENTS = 50  # of a second at which pollers ask, so that this process wakes seldom
_EPISODE = re.compile(rb'"id":"([^"]+)-(\d+)"')  # run and phase; index


@dataclass
class Seen:
    """What all clients saw."""

    latencies_ms: defaultdict[str, list[float]] = field(default_factory=lambda: defaultdict(list))  # by kind
    errors: Counter[str] = field(default_factory=Counter)
    episodes: int = 0
    repeated: int = 0
    missing: int = 0
    connections: int = 0  # of streams


def request(port: int, path: str, **headers: str) -> bytes:
    """A GET request as it is sent."""
    lines = [f"GET {path} HTTP/1.1", f"Host: {HOST}:{port}"]
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return "\r\n".join([*lines, "", ""]).encode()


async def head(reader: asyncio.StreamReader) -> tuple[int, dict[str, str]]:
    """Status and headers of an answer."""
    status, *lines = (await reader.readuntil(b"\r\n\r\n")).decode().rstrip().split("\r\n")
    pairs = (line.split(": ", 1) for line in lines)
    return int(status.split()[1]), {name.lower(): value for name, value in pairs}


async def poll(port: int, kind: str, campaign: str, due: float, end: float, conditional: bool, seen: Seen) -> None:
    """Asks every second; latencies count from when a request was due."""
    loop = asyncio.get_running_loop()
    path = (
        "/v1/campaigns" if kind == "list" else f"/v1/campaigns/{campaign}" + ("/results" if kind == "results" else "")
    )
    connection, tag = None, {}
    while due < end:
        await asyncio.sleep(due - loop.time())
        try:
            async with asyncio.timeout(PATIENCE_S):
                connection = connection or await asyncio.open_connection(HOST, port)
                connection[1].write(request(port, path, **tag))
                status, headers = await head(connection[0])
                await connection[0].readexactly(int(headers.get("content-length", 0)))
        except (OSError, EOFError) as error:  # a timeout is an OSError
            seen.errors[f"{kind}: {type(error).__name__} {error}".strip()] += 1
            if connection is not None:
                connection[1].close()
            connection = None
        else:
            seen.latencies_ms[kind].append(1e3 * (loop.time() - due))
            if status not in (200, 304):
                seen.errors[f"{kind}: status {status}"] += 1
            if conditional and "etag" in headers:
                tag = {"If_None_Match": headers["etag"]}
        due += PERIOD_S
    if connection is not None:
        connection[1].close()


async def follow(port: int, campaign: str, stays_s: float, chance: Random, seen: Seen) -> None:
    """Follows a campaign's events until cancelled, breaking off and resuming at times."""
    last: dict[str, str] = {}
    expected: dict[bytes, int] = {}  # index by run and phase
    await asyncio.sleep(chance.uniform(0, 2.0))
    while True:
        try:
            async with asyncio.timeout(stays_s * chance.uniform(0.5, 1.5)):
                async for block in _blocks(port, f"/v1/campaigns/{campaign}/events?newest=100", last, seen):
                    fields = dict(line.split(b": ", 1) for line in block.split(b"\n") if b": " in line[1:])
                    if b"id" not in fields:
                        continue
                    last = {"Last_Event_ID": fields[b"id"].decode()}
                    if fields[b"event"] != b"state" and (found := _EPISODE.search(fields[b"data"])):
                        run, index = found[1], int(found[2])
                        seen.episodes += 1
                        seen.repeated += index < expected.get(run, 0)
                        seen.missing += max(0, index - expected.get(run, index))
                        expected[run] = max(expected.get(run, 0), index + 1)
        except TimeoutError:
            continue
        except (OSError, EOFError) as error:
            seen.errors[f"stream: {type(error).__name__} {error}".strip()] += 1
        await asyncio.sleep(0.2)


async def _blocks(port: int, path: str, last: dict[str, str], seen: Seen) -> AsyncIterator[bytes]:
    """The blocks of an event stream, which blank lines end."""
    reader, writer = await asyncio.open_connection(HOST, port)
    try:
        writer.write(request(port, path, Accept="text/event-stream", **last))
        status, headers = await head(reader)
        seen.connections += 1
        if status not in (200, 204):
            seen.errors[f"stream: status {status}"] += 1
        text = b""
        while "chunked" in headers.get("transfer-encoding", "") and (size := int(await reader.readline(), 16)):
            *blocks, text = (text + (await reader.readexactly(size + 2))[:-2]).split(b"\n\n")
            for block in blocks:
                yield block
    finally:
        writer.close()


async def generate(options: argparse.Namespace) -> Seen:
    """Poll and follow for a while."""
    seen, chance = Seen(), Random(0)
    begin = asyncio.get_running_loop().time() + 0.1
    offsets = [PERIOD_S * (MOMENTS * number // options.pollers) / MOMENTS for number in range(options.pollers)]
    chance.shuffle(offsets)
    campaigns = options.campaigns
    streams = [
        asyncio.create_task(follow(options.port, campaigns[n % len(campaigns)], options.stays, Random(n), seen))
        for n in range(options.streams)
    ]
    polls = [
        poll(
            options.port,
            KINDS[n % len(KINDS)],
            campaigns[n // len(KINDS) % len(campaigns)],
            begin + offset,
            begin + options.seconds,
            chance.random() < CONDITIONAL,
            seen,
        )
        for n, offset in enumerate(offsets)
    ]
    await asyncio.gather(*polls)
    for stream in streams:
        stream.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await asyncio.gather(*streams)
    return seen


def main() -> int:
    """Generate load; returns 1 after an error or a broken stream."""
    parser = argparse.ArgumentParser(prog="python -m tests.load.generator", description=__doc__)
    parser.add_argument("campaigns", nargs="+", metavar="CAMPAIGN", help="ids of campaigns to look at")
    parser.add_argument("--port", type=int, required=True, help="of the service, on 127.0.0.1")
    parser.add_argument("--pollers", type=int, default=200, help="clients that ask every second")
    parser.add_argument("--streams", type=int, default=50, help="clients that follow events")
    parser.add_argument("--seconds", type=float, default=20.0, help="how long")
    parser.add_argument("--stays", type=float, default=60.0, help="how long a stream keeps its connection, s")
    options = parser.parse_args()
    # Clients elsewhere would push no worker off its core whenever they wake.
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    seen = asyncio.run(generate(options))
    json.dump(vars(seen) | {"seconds": options.seconds}, sys.stdout)
    return 1 if seen.errors or seen.repeated or seen.missing else 0


if __name__ == "__main__":
    sys.exit(main())
