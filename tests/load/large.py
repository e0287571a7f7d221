"""What one campaign of 100,000 episodes costs all other requests.

Its episodes are copies of those of a short run. Each route that reads all of them is asked once, while /healthz is
polled.
"""

import os
import sqlite3
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import httpx

from risk_sac.config import METHODS
from risk_sac.metrics import MetricsAccumulator, results_digest
from risk_sac.run_folder.results import (
    EPISODES,
    FAILURES,
    RESULTS,
    VERIFIED,
    RecordedFailure,
    read_results,
    records_from_lines,
    series_name,
    write_results,
)
from risk_sac.scenario.families import family_named
from tests.load.promises import Promise, at_most
from tests.server import LONG_S, Service, servers

HELD_MS, MEMORY_MIB = 100.0, 600.0
POLL_S = 0.005
SOURCE = 200  # episodes that are played
ANYWHERE = [name for name, method in METHODS.items() if method.prior != "policy"]  # methods for all families
MANY_RUNS = {"families": ["low", "mixed", "dense"], "methods": ANYWHERE[:12], "seeds": list(range(100))}
VIEWS = (
    "",  # what the machine itself costs
    *("/scenes", "/curves", "/failure-table?tier=raw", "/failures?tier=raw&limit=500", "/results"),
    *("/clusters", "/table?format=csv", "/report?format=html"),
    *("/figures", "/figures/ecr_low.png", "/figures/pcr_low.png"),
)


@dataclass(frozen=True)
class Asked:
    """What one request took, and the longest answers of /healthz meanwhile."""

    what: str
    status: int
    s: float
    healthz_ms: float
    server_ms: float  # the most processor time that the server took during one of them: the rest is the machine's
    answer_bytes: int


@dataclass(frozen=True)
class Measured:
    """What the campaign was asked."""

    memory_mib: float
    requests: list[Asked]


def measure(episodes: int) -> Measured:
    """Makes a campaign of so many episodes, restarts its service, and asks."""
    with tempfile.TemporaryDirectory() as folder, servers(Path(folder), lease_s=60) as serve:
        service = serve("risk_sac.execution.worker")
        service.wait(service.post(methods=["archive"], budget={"episodes": SOURCE}, ego={"profile": "defensive"}))
        service.stop()
        enlarge(service.data_dir, episodes // SOURCE)
        service.start()
        return ask(service)


def enlarge(data_dir: Path, times: int) -> None:
    """Repeats the episodes of the only run in a stopped server's folder."""
    (results,) = data_dir.glob(f"campaigns/*/*/{RESULTS}")
    folder, found = results.parent, read_results(results)
    played = records_from_lines((folder / EPISODES).read_bytes())
    records = [each.model_copy(update={"index": index}) for index, each in enumerate(played * times)]
    failures = [record for record in records if record.worst_violation is not None]
    for failure in failures[len(failures) // times :]:
        names = (series_name(index) for index in (failure.index % len(played), failure.index))
        os.link(*(folder / FAILURES / name for name in names))
    metrics = MetricsAccumulator(family_named(found.spec.family).horizon_steps)
    with (folder / EPISODES).open("w", encoding="utf-8") as lines:
        for record in records:
            metrics.add(record)
            lines.write(record.model_dump_json() + "\n")
    changes = {
        "metrics": metrics.metrics(),
        "digest": results_digest(records),
        "episode_cpu_s": tuple(0.1 * (index + 1) for index in range(len(records))),
        "failures": tuple(RecordedFailure.of(found.spec.id, failure) for failure in failures),
    }
    write_results(folder, replace(found, **changes))
    (folder / VERIFIED).unlink(missing_ok=True)  # of the run as it was
    with sqlite3.connect(data_dir / "risk-sac.db") as database:
        _repeat(database, len(played), times, changes["digest"])


def _repeat(database: sqlite3.Connection, played: int, times: int, digest: str) -> None:
    """Repeat the rows of the only run's episodes."""
    (events,) = database.execute("SELECT events FROM campaigns").fetchone()
    columns = [row[1] for row in database.execute("PRAGMA table_info(episodes)") if row[1] != "number"]
    index = f'"index" + repeated.value * {played}'
    changed = {
        "index": index,
        "sequence": f'"sequence" + repeated.value * {events}',
        "record": f"json_set(record, '$.index', {index})",
        "series": f"CASE WHEN series IS NOT NULL THEN printf('%06d.npz', {index}) END",
    }
    names = ", ".join(f'"{name}"' for name in columns)
    values = ", ".join(changed.get(name, f'"{name}"') for name in columns)
    numbers = (
        f"WITH RECURSIVE repeated(value) AS (VALUES(1) UNION ALL SELECT value + 1 FROM repeated LIMIT {times - 1})"
    )
    database.execute(f"{numbers} INSERT INTO episodes ({names}) SELECT {values} FROM repeated, episodes")
    database.execute(f"UPDATE campaigns SET events = events * {times}")
    done = f"episodes_done = episodes_done * {times}, episodes_total = episodes_total * {times}"
    database.execute(f"UPDATE runs SET {done}, digest = ?", [digest])


def ask(service: Service) -> Measured:
    """Ask a service with one campaign."""
    (campaign,) = service.client.get("/v1/campaigns").json()["items"]
    here, prior = (
        f"/v1/campaigns/{campaign['id']}",
        {"families": ["low"], "methods": ["archive"], "prior": campaign["id"]},
    )
    wanted: list[tuple[str, str, dict[str, Any] | None]] = [("GET", here + view, None) for view in VIEWS]
    wanted += [("POST", "/v1/campaigns/check", prior), ("POST", "/v1/campaigns/check", prior)]
    wanted += [("POST", "/v1/campaigns", MANY_RUNS | {"budget": {"episodes": 10}})]
    requests = [_asked(service, *each) for each in wanted]
    many = service.client.get("/v1/campaigns?limit=1").json()["items"][0]["id"]
    wanted = [("GET", f"/v1/campaigns/{many}{part}", None) for part in ("", "/results")]
    wanted += [("POST", f"/v1/campaigns/{many}/cancel", None), ("DELETE", here, None)]
    requests += [_asked(service, *each) for each in wanted]
    status = Path(f"/proc/{service.process.pid}/status").read_text()
    peak_kib = int(status.partition("VmHWM:")[2].split()[0])
    return Measured(peak_kib / 1024, requests)


def _asked(service: Service, method: str, path: str, body: dict[str, Any] | None) -> Asked:
    """Ask once while /healthz is polled."""
    latencies_ms, busy_ms, over = [0.0], [0.0], threading.Event()
    clock = (~service.process.pid << 3) | 2  # processor time of a process, as Linux numbers its clocks

    def poll() -> None:
        with httpx.Client(base_url=service.client.base_url, timeout=LONG_S) as client:
            while not over.is_set():
                began, used = time.perf_counter(), time.clock_gettime(clock)
                client.get("/healthz")
                latencies_ms.append(1e3 * (time.perf_counter() - began))
                busy_ms.append(1e3 * (time.clock_gettime(clock) - used))
                time.sleep(POLL_S)

    polling = threading.Thread(target=poll)
    polling.start()
    began = time.perf_counter()
    answer = service.client.request(method, path, json=body, timeout=LONG_S)
    took_s = time.perf_counter() - began
    over.set()
    polling.join()
    what = f"{method} {path.partition('/v1/campaigns')[2]}"
    return Asked(what, answer.status_code, took_s, max(latencies_ms), max(busy_ms), len(answer.content))


def judge(measured: Measured) -> Iterator[Promise]:
    """All promises."""
    for each in measured.requests:
        note = (
            f"; server busy for {each.server_ms:.0f}; {each.status} in {each.s:.1f} s, {each.answer_bytes / 1e6:.1f} MB"
        )
        yield at_most(f"{each.what}: longest /healthz", HELD_MS, each.healthz_ms, "ms", note)
    yield at_most("peak memory of the server", MEMORY_MIB, measured.memory_mib, "MiB")
