"""What one campaign of 100,000 episodes costs all other requests.

Its run is copied from a short one and imported. Then each route that reads all of its episodes is asked once, while
/healthz is polled.
"""

import os
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
    RecordedFailure,
    Results,
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
MANY_RUNS = {"families": ["low", "mixed", "dense"], "methods": list(METHODS)[:12], "seeds": list(range(100))}
VIEWS = (
    *("/scenes", "/curves", "/failure-table?tier=raw", "/failures?tier=raw&limit=500", "/results"),
    *("/clusters", "/table?format=csv", "/table?format=json", "/report?format=json", "/report?format=html"),
    *("/figures", "/figures/ecr_low.png", "/figures/distinct_found_low.svg"),
)


@dataclass(frozen=True)
class Asked:
    """What one request took, and the longest answer of /healthz meanwhile."""

    what: str
    status: int
    s: float
    healthz_ms: float
    answer_bytes: int


@dataclass(frozen=True)
class Measured:
    """What the campaign was asked."""

    import_s: float
    memory_mib: float
    requests: list[Asked]


def measure(episodes: int) -> Measured:
    """Import a campaign of so many episodes, start a service on it, and ask."""
    with tempfile.TemporaryDirectory() as folder, servers(Path(folder), lease_s=60) as serve:
        service = serve("risk_sac.execution.worker")
        campaign = service.post(methods=["archive"], budget={"episodes": SOURCE})
        service.wait(campaign)
        service.client.post("/v1/campaigns/check", json={"families": ["low"], "methods": ["archive"]})
        service.stop()
        (source,) = (each.parent for each in service.data_dir.glob("campaigns/*/*/results.json"))
        multiply(source, Path(folder, "many", source.name), episodes)
        began = time.monotonic()
        importing = serve("risk_sac.execution.worker", data_dir=Path(folder, "large"), runs=Path(folder, "many"))
        imported_s = time.monotonic() - began
        importing.stop()
        return ask(serve("risk_sac.execution.worker", data_dir=importing.data_dir), imported_s)


def multiply(source: Path, folder: Path, episodes: int) -> None:
    """Write the folder of a run with so many episodes, copies of those of another run."""
    (folder / FAILURES).mkdir(parents=True)
    found, played = read_results(source), records_from_lines((source / EPISODES).read_bytes())
    spec = found.spec.model_copy(update={"budget": found.spec.budget.model_copy(update={"episodes": episodes})})
    records = [played[index % len(played)].model_copy(update={"index": index}) for index in range(episodes)]
    metrics = MetricsAccumulator(family_named(spec.family).horizon_steps)
    with (folder / EPISODES).open("w", encoding="utf-8") as lines:
        for record in records:
            metrics.add(record)
            lines.write(record.model_dump_json() + "\n")
    failures = [record for record in records if record.worst_violation is not None]
    for failure in failures:
        of = series_name(played[failure.index % len(played)].index)
        os.link(source / FAILURES / of, folder / FAILURES / series_name(failure.index))
    results: Results = replace(
        found,
        spec=spec,
        spec_digest=spec.digest,
        metrics=metrics.metrics(),
        digest=results_digest(records),
        episode_cpu_s=tuple(0.1 * (index + 1) for index in range(episodes)),
        failures=tuple(RecordedFailure.of(spec.id, failure) for failure in failures),
    )
    write_results(folder, results)


def ask(service: Service, import_s: float) -> Measured:
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
    peak = next(
        line for line in Path(f"/proc/{service.process.pid}/status").read_text().splitlines() if "VmHWM" in line
    )
    return Measured(import_s, int(peak.split()[1]) / 1024, requests)


def _asked(service: Service, method: str, path: str, body: dict[str, Any] | None) -> Asked:
    """Ask once while /healthz is polled."""
    longest, over = [0.0], threading.Event()

    def poll() -> None:
        with httpx.Client(base_url=service.client.base_url, timeout=LONG_S) as client:
            while not over.is_set():
                began = time.perf_counter()
                client.get("/healthz")
                longest[0] = max(longest[0], 1e3 * (time.perf_counter() - began))
                time.sleep(POLL_S)

    polling = threading.Thread(target=poll)
    polling.start()
    began = time.perf_counter()
    answer = service.client.request(method, path, json=body, timeout=LONG_S)
    took_s = time.perf_counter() - began
    over.set()
    polling.join()
    what = f"{method} {path.partition('/v1/campaigns')[2]}"
    return Asked(what, answer.status_code, took_s, longest[0], len(answer.content))


def judge(measured: Measured) -> Iterator[Promise]:
    """All promises."""
    yield Promise("imported within", "", f"{measured.import_s:.0f} s")
    for each in measured.requests:
        note = f"; {each.status} in {each.s:.1f} s, {each.answer_bytes / 1e6:.1f} MB"
        yield at_most(f"{each.what}: longest /healthz", HELD_MS, each.healthz_ms, "ms", note)
    yield at_most("peak memory of the server", MEMORY_MIB, measured.memory_mib, "MiB")
