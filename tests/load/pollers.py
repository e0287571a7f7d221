"""Clients that ask again every second."""

import asyncio
from collections import Counter, defaultdict
from dataclasses import dataclass, field

from tests.load.wire import Answer, Polling, WireError, get

PERIOD_S = 1.0
PATIENCE_S = 10.0
GOOD = (200, 304)


@dataclass(frozen=True, slots=True)
class Poller:
    """One client: what it asks for, when in the second, and whether it says what it has already."""

    kind: str  # of the request, for the report
    path: str
    offset_s: float
    conditional: bool


@dataclass(slots=True)
class Polls:
    """What the pollers saw."""

    latencies_ms: defaultdict[str, list[float]] = field(default_factory=lambda: defaultdict(list))  # by kind
    answers: Counter[str] = field(default_factory=Counter)  # by kind and status
    errors: Counter[str] = field(default_factory=Counter)  # by kind and what went wrong


async def poll(poller: Poller, port: int, begin: float, end: float, polls: Polls) -> None:
    """Ask from one moment of the loop's clock to another.

    A latency counts from the moment at which the request was due, so that a server that makes its clients wait does not
    thereby ask less of itself.
    """
    loop = asyncio.get_running_loop()
    plain = get(port, poller.path)
    connection: Polling | None = None
    request, due = plain, begin + poller.offset_s
    while due < end:
        await asyncio.sleep(due - loop.time())
        try:
            async with asyncio.timeout(PATIENCE_S):
                connection = connection or await Polling.open(port)
                answer = await connection.ask(request)
        except (OSError, WireError) as error:  # a timeout is an OSError
            polls.errors[f"{poller.kind}: {type(error).__name__} {error}".strip()] += 1
            if connection is not None:
                connection.close()
                connection = None
        else:
            polls.latencies_ms[poller.kind].append(1e3 * (loop.time() - due))
            polls.answers[f"{poller.kind} {answer.status}"] += 1
            request = _next(poller, port, plain, request, answer)
            if answer.status not in GOOD:
                polls.errors[f"{poller.kind}: status {answer.status}"] += 1
        due += PERIOD_S
    if connection is not None:
        connection.close()


def _next(poller: Poller, port: int, plain: bytes, last: bytes, answer: Answer) -> bytes:
    if not poller.conditional or answer.status == 304:
        return last
    return plain if answer.tag is None else get(port, poller.path, f"If-None-Match: {answer.tag.decode()}")
