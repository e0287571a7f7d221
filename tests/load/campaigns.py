"""Two campaigns at work, with and without clients.

Quiet and loaded phases follow each other as A B B A B A A B, so that what changes slowly, like the length of episodes
while a policy learns, changes both alike. Where there are as many workers as cores, the generator's processor time is
taken from the workers, which clients elsewhere would not do. So the workers are given it back, at the pace they had,
before the loss of throughput is judged.
"""

import itertools
import json
import math
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from tests.load.promises import Promise, at_most, percentile
from tests.server import ROOT, Service, servers

SPEC: dict[str, Any] = {"families": ["low"], "methods": ["risk-sac"], "budget": {"episodes": 100_000}}
CAMPAIGNS = 2
SETTLE_S = 3.0  # at the beginning of each phase, while clients connect
LATENCY_MS, LOSS, GROWTH_MIB, GROWTH_FILES = 100.0, 0.10, 10.0, 5.0
ORDER = (False, True, True, False, True, False, False, True)  # whether a phase is loaded


@dataclass(frozen=True, kw_only=True)
class Phase:
    """What happened in a while; processor time in s."""

    loaded: bool
    wall_s: float
    steps: int
    server_s: float
    workers_s: float
    generator_s: float
    memory_mib: float  # of the server, like the next one a median
    files: float
    seen: dict[str, Any] = field(default_factory=dict)  # by the generator


def measure(seconds: float, phase_s: float, warm_up_s: float, pollers: int, streams: int) -> list[Phase]:
    """Runs the phases on a service of their own, `seconds` under load."""
    with tempfile.TemporaryDirectory() as folder, servers(Path(folder)) as serve:
        service = serve("risk_sac.execution.worker", lease_s=60)
        ids = [service.post(label=f"campaign {seed}", seeds=[seed], **SPEC) for seed in range(CAMPAIGNS)]
        service.wait_until(lambda: all(service.get(each)["progress"]["episodes_done"] for each in ids))
        time.sleep(warm_up_s)
        workers = service.workers()
        count = 2 * max(2, math.ceil(seconds / phase_s))
        phases = [
            _phase(service, ids, workers, phase_s, (pollers, streams) if loaded else None)
            for loaded in itertools.islice(itertools.cycle(ORDER), count)
        ]
        if sorted(service.workers()) != sorted(workers):
            raise RuntimeError(f"workers were replaced, so throughput means nothing; see {service.log}")
        return phases


def _phase(
    service: Service, ids: Sequence[str], workers: Sequence[int], phase_s: float, load: tuple[int, int] | None
) -> Phase:
    generator = None
    if load:
        flags = [f"--port={service.port}", f"--pollers={load[0]}", f"--streams={load[1]}"]
        command = [sys.executable, "-m", "tests.load.generator", *flags, f"--seconds={phase_s + SETTLE_S + 1}", *ids]
        generator = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE)
    time.sleep(SETTLE_S)
    server, samples = psutil.Process(service.process.pid), []
    pids = {"server_s": [server.pid], "workers_s": workers, "generator_s": [generator.pid] if generator else []}

    def reading() -> dict[str, float]:
        runs = [run for each in ids for run in service.get(each)["runs"]]
        used = {name: sum(_processor_s(pid) for pid in of) for name, of in pids.items()}
        return {"wall_s": time.monotonic(), "steps": sum(run["metrics"]["environment_steps"] for run in runs)} | used

    over = threading.Event()

    def watch() -> None:
        while not over.wait(1.0):
            samples.append((server.memory_info().rss / (1 << 20), server.num_fds()))

    watching = threading.Thread(target=watch, daemon=True)
    watching.start()
    before = reading()
    time.sleep(phase_s)
    after = reading()
    over.set()
    watching.join()
    memory_mib, files = (statistics.median(each) for each in zip(*samples, strict=True))
    seen = json.loads(generator.communicate(timeout=60)[0]) if generator else {}
    spent = {name: after[name] - before[name] for name in before}
    return Phase(loaded=load is not None, memory_mib=memory_mib, files=files, seen=seen, **spent)


def _processor_s(pid: int) -> float:
    times = psutil.Process(pid).cpu_times()
    return times.user + times.system


def judge(phases: Sequence[Phase]) -> Iterator[Promise]:
    """All promises, from equally many quiet and loaded phases."""
    quiet, loaded = ([phase for phase in phases if phase.loaded is which] for which in (False, True))
    for kind in loaded[0].seen["latencies_ms"]:
        times = [each for phase in loaded for each in phase.seen["latencies_ms"][kind]]
        note = f"; p50 {percentile(times, 50):.1f}, p95 {percentile(times, 95):.1f}, max {max(times):.0f}"
        yield at_most(f"polls of {kind}: p99", LATENCY_MS, percentile(times, 99), "ms", note)
    errors = sum((Counter(phase.seen["errors"]) for phase in loaded), Counter())
    yield Promise("errors", "none", str(dict(errors.most_common(5))), not errors)
    told, repeated, missing = (
        sum(phase.seen[name] for phase in loaded) for name in ("episodes", "repeated", "missing")
    )
    streams = f"{told:,} episodes, {repeated} repeated, {missing} missing"
    yield Promise("streams tell every episode", "exactly once", streams, not (repeated or missing))
    losses = [_loss([a], [b]) for a, b in zip(quiet, loaded, strict=True)]
    note = f" (± {100 * statistics.stdev(losses) / len(losses) ** 0.5:.1f})"
    yield at_most("campaigns slowed down by the service", 100 * LOSS, 100 * _loss(quiet, loaded), "%", note)
    for name in ("workers_s", "server_s", "generator_s"):
        cores = f"{_rate(quiet, name):.3f} quiet, {_rate(loaded, name):.3f} loaded"
        yield Promise(f"cores of {name.removesuffix('_s')}", "", cores)
    first, last = loaded[1], loaded[-1]  # in the very first, pools fill up
    yield at_most("server's memory grows by", GROWTH_MIB, last.memory_mib - first.memory_mib, "MiB")
    yield at_most("open files grow by", GROWTH_FILES, last.files - first.files, "")


def _rate(phases: Sequence[Phase], name: str) -> float:
    return sum(getattr(phase, name) for phase in phases) / sum(phase.wall_s for phase in phases)


def _loss(quiet: Sequence[Phase], loaded: Sequence[Phase]) -> float:
    """Returns the throughput lost under load, the generator's own time deducted."""
    had, has = _rate(quiet, "workers_s"), _rate(loaded, "workers_s")
    given_back = max(has, min(had, has + _rate(loaded, "generator_s"))) / has
    return 1 - _rate(loaded, "steps") * given_back / _rate(quiet, "steps")
