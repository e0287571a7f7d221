"""What a service answers that has run for years: 10,000 campaigns with 1,000,000 episodes in its database.

One client asks at a time, so that a latency is what one answer costs. Each question is asked anew each time: with
another cursor, or about another campaign, so that nothing is answered from memory.
"""

import asyncio
import json
import tempfile
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from risk_sac.config import METHODS
from risk_sac.scenario.families import FAMILIES
from service.api.answers.pages import Cursors
from service.api.routes.campaigns import LISTED
from service.settings import ServiceSettings
from service.store.database import connect
from service.store.server import cursor_secret
from service.store.states import FINAL
from tests.load.population import LABELS, RARE_LABEL, Plan, populate
from tests.load.resources import processor_s
from tests.load.verdicts import Verdict, at_most, percentile
from tests.load.wire import HOST, Polling, Streaming, WireError, get
from tests.server import Service, servers

LATENCY_MS, START_S = 50.0, 20.0
FIRST = {"families": ["low"], "methods": ["bo-only"], "budget": {"episodes": 40}}  # the pattern of all others
WARM_UP, ASKED = 20, 200  # times each
NEWER = 1 << 40  # than any campaign
PATIENCE_S = 30.0

Question = Callable[[Random], str]  # a path


@dataclass(frozen=True, slots=True)
class Answers:
    """How long one question took, again and again."""

    latencies_ms: list[float]
    processor_ms: float  # of the server for one answer, in the mean


@dataclass(frozen=True, slots=True)
class Measured:
    """What the large database was asked."""

    size_bytes: int
    fill_s: float
    start_s: float
    answers: dict[str, Answers]


def measure(campaigns: int, episodes: int) -> Measured:
    """Fill a database, start a service on it, and ask."""
    with tempfile.TemporaryDirectory() as folder, servers(Path(folder)) as serve:
        service = serve("service.worker", lease_s=60, rate_limit=1_000_000)
        service.wait(service.post(**FIRST))
        service.stop()
        began = time.monotonic()
        plans = populate(service.data_dir, campaigns, episodes)
        filled = time.monotonic()
        service.start()
        started = time.monotonic()
        answers = asyncio.run(Asking(service, plans).all())
        size = sum(path.stat().st_size for path in service.data_dir.glob("risk-sac.db*"))
        return Measured(size, filled - began, started - filled, answers)


def judge(measured: Measured) -> list[Verdict]:
    """All verdicts."""
    gib = f"; {measured.size_bytes / (1 << 30):.1f} GiB, filled in {measured.fill_s:.0f} s"
    verdicts = [at_most("the service starts within", START_S, measured.start_s, "s", gib)]
    for name, answers in measured.answers.items():
        times = answers.latencies_ms
        note = f"; p50 {percentile(times, 50):.1f}, max {max(times):.0f}, processor {answers.processor_ms:.1f}"
        verdicts.append(at_most(f"{name}: p99", LATENCY_MS, percentile(times, 99), "ms", note))
    return verdicts


class Asking:
    """One client."""

    def __init__(self, service: Service, plans: Sequence[Plan]) -> None:
        self._port = service.port
        self._cursors = Cursors(cursor_secret(connect(ServiceSettings(data_dir=service.data_dir).url)))
        self._server = service.process.pid
        self._plans = plans
        self._large = max(plans, key=lambda plan: len(plan.spec.runs()))
        self._chance = Random(0)

    async def all(self) -> dict[str, Answers]:
        """All questions, one after another."""
        connection = await Polling.open(self._port)
        contacts = await self._contacts(connection)
        questions = _lists(self._plans, self._cursors)
        questions |= _campaigns(self._plans, self._large, contacts, self._cursors)
        answers = {
            name: await self._time(lambda path=path: self._ask(connection, path(self._chance)))
            for name, path in questions.items()
        }
        connection.close()
        return answers | {"first event": await self._time(self._first_event)}

    async def _time(self, ask: Callable[[], Awaitable[float]]) -> Answers:
        for _ in range(WARM_UP):
            await ask()
        began_s = processor_s(self._server)
        latencies = [await ask() for _ in range(ASKED)]
        return Answers(latencies, 1e3 * (processor_s(self._server) - began_s) / ASKED)

    async def _ask(self, connection: Polling, path: str) -> float:
        request = get(self._port, path)
        began = time.perf_counter()
        async with asyncio.timeout(PATIENCE_S):
            answer = await connection.ask(request)
        took_ms = 1e3 * (time.perf_counter() - began)
        if answer.status != 200:
            raise WireError(f"{request!r} was answered with {answer.status}: {answer.body[:500]!r}")
        return took_ms

    async def _contacts(self, connection: Polling) -> list[str]:
        """Ids of failures of the largest campaign."""
        path = f"/v1/campaigns/{self._large.id}/failures?tier=raw&limit=500"
        answer = await connection.ask(get(self._port, path))
        page: dict[str, Any] = json.loads(answer.body)
        return [item["id"] for item in page["items"]]

    async def _first_event(self) -> float:
        """Time until a new stream of any campaign tells of something, ms."""
        told = asyncio.Event()

        def hear(block: bytes) -> None:
            if b"data: " in block:
                told.set()

        request = get(self._port, f"/v1/campaigns/{self._chance.choice(self._plans).id}/events")
        began = time.perf_counter()
        _, stream = await asyncio.get_running_loop().create_connection(
            lambda: Streaming(request, hear), HOST, self._port
        )
        async with asyncio.timeout(PATIENCE_S):
            await told.wait()
        took_ms = 1e3 * (time.perf_counter() - began)
        stream.close()
        return took_ms


def _lists(plans: Sequence[Plan], cursors: Cursors) -> dict[str, Question]:
    """Pages of campaigns; the newest ones by a cursor that no request before had."""
    families, methods, states = list(FAMILIES), list(METHODS), sorted(FINAL)

    def older(number: int) -> str:
        return f"/v1/campaigns?cursor={cursors.encode(number, LISTED, None)}"

    def newest(chance: Random) -> str:
        return older(NEWER + chance.getrandbits(30))

    def deep(chance: Random) -> str:
        return older(chance.choice(plans).number)

    def narrow(chance: Random) -> str:
        search = f"&family={chance.choice(families)}&method={chance.choice(methods)}"
        return f"{deep(chance)}{search}&state={chance.choice(states)}&label={chance.choice(LABELS)}"

    return {
        "list": newest,
        "list, somewhere": deep,
        "list by state": lambda chance: f"{newest(chance)}&state={chance.choice(states)}",
        "list by a state that none has": lambda chance: f"{newest(chance)}&state=paused",
        "list by family": lambda chance: f"{newest(chance)}&family={chance.choice(families)}",
        "list by method": lambda chance: f"{newest(chance)}&method={chance.choice(methods)}",
        "list by label": lambda chance: f"{newest(chance)}&label={chance.choice(LABELS)}",
        "list by a label that one has": lambda chance: f"{newest(chance)}&label={RARE_LABEL}",
        "list by all of them": narrow,
    }


def _campaigns(plans: Sequence[Plan], large: Plan, contacts: Sequence[str], cursors: Cursors) -> dict[str, Question]:
    """What is asked about one campaign: any of them, and the largest, which has many runs."""
    runs = [run.id for run in large.spec.runs()]
    episodes = f"/v1/campaigns/{large.id}/episodes"
    failures = f"/v1/campaigns/{large.id}/failures"

    def about(part: str) -> Question:
        return lambda chance: f"/v1/campaigns/{chance.choice(plans).id}{part}"

    def somewhere(path: str) -> Question:
        # Numbers of episodes lie between those of the campaigns and a few hundred times as much.
        return lambda chance: f"{path}cursor={cursors.encode(chance.randrange(1, len(plans) * 100), large.id, None)}"

    return {
        "status": about(""),
        "results": about("/results"),
        "episodes": about("/episodes"),
        "failures": about("/failures"),
        "spec": about("/spec"),
        f"status, {len(runs)} runs": lambda _: f"/v1/campaigns/{large.id}",
        f"results, {len(runs)} runs": lambda _: f"/v1/campaigns/{large.id}/results",
        "its episodes, somewhere": somewhere(f"{episodes}?"),
        "its episodes of one run": lambda chance: f"{episodes}?run={chance.choice(runs)}",
        "its episodes by outcome": lambda chance: f"{episodes}?outcome={chance.choice(['safe', 'failure'])}",
        "its contacts, somewhere": somewhere(f"{failures}?tier=raw&"),
        "its failures of one run": lambda chance: f"{failures}?run={chance.choice(runs)}",
        "one of its failures": lambda chance: f"{failures}/{chance.choice(contacts)}",
        "metrics": lambda _: "/metrics",
        "readiness": lambda _: "/readyz",
    }
