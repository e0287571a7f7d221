"""Answers of a large service: 10,000 campaigns with 1,000,000 stored episodes.

The rows are copies of those of one real campaign, made by SQL whatever columns the tables have. One client asks at a
time, so that a latency is what one answer costs.
"""

import itertools
import json
import sqlite3
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

from risk_sac.config import METHODS, RunSpec
from risk_sac.scenario.families import FAMILIES
from tests.load.promises import Promise, at_most, percentile
from tests.server import Service, servers

LATENCY_MS, START_S = 50.0, 20.0
WARM_UP, ASKED = 20, 200  # times each
LABELS, RARE_LABEL = ("", "nightly", "release", "cut-ins"), "seldom"
STORED = list(METHODS)[:20]  # as many as a campaign may have
STATES = ("succeeded",) * 17 + ("failed", "failed", "cancelled")
LARGE_SHARE = 0.06  # of the episodes, in one campaign with many runs

Values = Mapping[str, Any]
Question = Callable[[Random], str]  # a path


@dataclass(frozen=True)
class Measured:
    """What the large database was asked."""

    size_bytes: int
    fill_s: float
    start_s: float
    latencies_ms: dict[str, list[float]]


def measure(campaigns: int, episodes: int) -> Measured:
    """Fill a database, start a service on it, and ask."""
    first = {"families": ["low"], "methods": ["bo-only"], "budget": {"episodes": max(1, episodes // campaigns)}}
    with tempfile.TemporaryDirectory() as folder, servers(Path(folder)) as serve:
        service = serve("risk_sac.execution.worker", lease_s=60, rate_limit=1_000_000)
        service.wait(service.post(**first))
        service.stop()
        began = time.monotonic()
        ids, large = populate(service.data_dir / "risk-sac.db", campaigns, round(LARGE_SHARE * campaigns))
        filled = time.monotonic()
        service.start()
        started = time.monotonic()
        chance = Random(0)
        latencies = {name: _time(service, path, chance) for name, path in _questions(service, ids, large).items()}
        latencies["first event"] = [_first_event(service, chance.choice(ids)) for _ in range(ASKED)]
        size = sum(path.stat().st_size for path in service.data_dir.glob("risk-sac.db*"))
        return Measured(size, filled - began, started - filled, latencies)


def judge(measured: Measured) -> Iterator[Promise]:
    """All promises."""
    gib = f"; {measured.size_bytes / (1 << 30):.1f} GiB, filled in {measured.fill_s:.0f} s"
    yield at_most("the service starts within", START_S, measured.start_s, "s", gib)
    for name, times in measured.latencies_ms.items():
        note = f"; p50 {percentile(times, 50):.1f}, max {max(times):.0f}"
        yield at_most(f"{name}: p99", LATENCY_MS, percentile(times, 99), "ms", note)


def populate(file: Path, campaigns: int, runs: int) -> tuple[list[str], str]:
    """Copies a database's campaign, once with many runs; returns the ids."""
    with sqlite3.connect(file) as database:
        database.row_factory = sqlite3.Row
        (campaign,) = database.execute("SELECT * FROM campaigns").fetchall()
        (run,) = database.execute("SELECT * FROM runs").fetchall()
        searches = list(itertools.product(FAMILIES, STORED))
        ids, now = [], time.time()
        for place in range(campaigns):
            label = RARE_LABEL if place == campaigns // 10 else LABELS[place % len(LABELS)]
            state, at = STATES[place * 3 % len(STATES)], now - 60.0 * (campaigns - place)
            large = place == campaigns // 2
            wanted = range(runs) if large else [place * 7]
            own = [(*searches[each % len(searches)], each // len(searches) if large else 0) for each in wanted]
            number = place + 2
            ids.append(f"c{number:016x}")
            columns = {"number": number, "id": ids[-1], "label": label, "state": state, "created_at": at}
            spec = json.loads(campaign["spec"]) | {
                "label": label,
                "families": list(dict.fromkeys(each[0] for each in own)),
                "methods": list(dict.fromkeys(each[1] for each in own)),
                "seeds": sorted({each[2] for each in own}),
            }
            events = campaign["events"] * len(own)
            _insert(database, "campaigns", dict(campaign) | columns | {"spec": json.dumps(spec), "events": events})
            for nth, (family, method, seed) in enumerate(own):
                _copy_run(
                    database,
                    run,
                    number,
                    RunSpec(family=family, method=method, seed=seed),
                    state,
                    nth * campaign["events"],
                )
        return ids, ids[campaigns // 2]


def _copy_run(
    database: sqlite3.Connection, run: sqlite3.Row, campaign: int, spec: RunSpec, state: str, offset: int
) -> None:
    """Copies a run with episodes and events, whose places grow by `offset`."""
    names = {"family": spec.family, "method": spec.method, "seed": spec.seed, "spec_digest": spec.digest}
    number = _insert(
        database,
        "runs",
        {name: run[name] for name in run.keys() if name != "number"}  # noqa: SIM118
        | names
        | {"campaign_number": campaign, "id": spec.id, "state": state},
    )
    for table, replaced in (
        ("episodes", {"campaign_number": campaign, "run_number": number}),
        ("changes", {"campaign_number": campaign}),
    ):
        columns = [row[1] for row in database.execute(f"PRAGMA table_info({table})") if row[1] != "number"]
        chosen = [
            str(replaced[name]) if name in replaced else f'"sequence" + {offset}' if name == "sequence" else f'"{name}"'
            for name in columns
        ]
        if table == "changes":
            chosen = [
                "CASE WHEN run_id IS NULL THEN NULL ELSE :id END" if each == '"run_id"' else each for each in chosen
            ]
        listed = ", ".join(f'"{name}"' for name in columns)
        where = f"run_number = {run['number']}" if table == "episodes" else "campaign_number = 1"
        database.execute(
            f"INSERT INTO {table} ({listed}) SELECT {', '.join(chosen)} FROM {table} WHERE {where}", {"id": spec.id}
        )


def _insert(database: sqlite3.Connection, table: str, row: Values) -> int:
    names = ", ".join(f'"{name}"' for name in row)
    cursor = database.execute(f"INSERT INTO {table} ({names}) VALUES ({', '.join('?' * len(row))})", list(row.values()))
    return int(cursor.lastrowid or 0)


def _time(service: Service, path: Question, chance: Random) -> list[float]:
    times = []
    for _ in range(WARM_UP + ASKED):
        asked = path(chance)
        began = time.perf_counter()
        answer = service.client.get(asked)
        times.append(1e3 * (time.perf_counter() - began))
        assert answer.status_code == 200, f"{asked}: {answer.text[:500]}"
    return times[WARM_UP:]


def _first_event(service: Service, campaign: str) -> float:
    """Time until a new stream tells something, ms."""
    began = time.perf_counter()
    with service.client.stream("GET", f"/v1/campaigns/{campaign}/events") as stream:
        next(line for line in stream.iter_lines() if line.startswith("data: "))
        return 1e3 * (time.perf_counter() - began)


def _cursors(service: Service, path: str) -> list[str]:
    """The cursors of all pages of a list."""
    found: list[str] = []
    while len(found) < 200:
        after = {"cursor": found[-1]} if found else {}
        cursor = service.client.get(path, params={"limit": 100} | after).json()["next"]
        if cursor is None:
            break
        found.append(cursor)
    return found


def _questions(service: Service, ids: list[str], large: str) -> dict[str, Question]:
    """What is asked; a random limit keeps answers from being remembered."""
    families, methods = list(FAMILIES), STORED
    runs = [run["id"] for run in service.get(large)["runs"]]
    contacts = [each["id"] for each in service.get(large, "/failures", tier="raw", limit=500)["items"]]
    pages = {path: _cursors(service, path) for path in ("/v1/campaigns", f"/v1/campaigns/{large}/episodes")}

    def listed(path: str, **filters: list[str]) -> Question:
        def ask(chance: Random) -> str:
            chosen = "".join(f"&{name}={chance.choice(values)}" for name, values in filters.items())
            return f"{path}?limit={chance.randint(20, 50)}{chosen}"

        return ask

    def about(part: str) -> Question:
        return lambda chance: f"/v1/campaigns/{chance.choice(ids)}{part}"

    assert contacts, "the copied campaign has no contact; wanted one to ask for"
    campaigns, of_large = "/v1/campaigns", f"/v1/campaigns/{large}"
    narrow = {"family": families, "method": methods, "state": sorted(set(STATES)), "label": list(LABELS[1:])}
    return {
        "list": listed(campaigns),
        "list, somewhere": listed(campaigns, cursor=pages[campaigns]),
        "list by a state that none has": listed(campaigns, state=["paused"]),
        **{f"list by {name}": listed(campaigns, **{name: values}) for name, values in narrow.items()},
        "list by a label that one has": listed(campaigns, label=[RARE_LABEL]),
        "list by all of them": listed(campaigns, **narrow),
        **{part: about(f"/{part}") for part in ("results", "episodes", "failures", "spec")},
        "status": about(""),
        f"status, {len(runs)} runs": lambda _: of_large,
        f"results, {len(runs)} runs": lambda _: f"{of_large}/results",
        "its episodes, somewhere": listed(f"{of_large}/episodes", cursor=pages[f"{of_large}/episodes"]),
        "its episodes of one run": listed(f"{of_large}/episodes", run=runs),
        "its episodes by outcome": listed(f"{of_large}/episodes", outcome=["safe", "failure"]),
        "its failures of one run": listed(f"{of_large}/failures", run=runs),
        "one of its failures": lambda chance: f"{of_large}/failures/{chance.choice(contacts)}",
        "metrics": lambda _: "/metrics",
        "readiness": lambda _: "/readyz",
    }
