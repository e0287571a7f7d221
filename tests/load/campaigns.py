"""Two campaigns at work, with and without clients that look on.

Quiet and loaded phases follow each other as A B B A B A A B, so that what changes slowly, like the length of episodes
while a policy learns, changes both alike, be it at a falling rate.
"""

import itertools
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.load.resources import Holding, Watch, processor_s
from tests.server import ROOT, Service, servers

SPEC: dict[str, Any] = {"families": ["low"], "methods": ["risk-sac"], "budget": {"episodes": 100_000}}
CAMPAIGNS = 2
SETTLE_S = 3.0  # at the beginning of each phase, while clients connect


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """How much load, and for how long."""

    seconds: float = 600.0  # with load, all phases together
    phase_s: float = 30.0
    warm_up_s: float = 120.0
    pollers: int = 200
    streams: int = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Clocks and counters at one moment."""

    at: float
    steps: int
    episodes: int
    server_s: float
    workers_s: float
    generator_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """What happened between two readings."""

    loaded: bool
    wall_s: float
    steps: int
    episodes: int
    server_s: float
    workers_s: float
    generator_s: float
    holding: Holding
    seen: dict[str, Any] = field(default_factory=dict)  # by the generator


def measure(trial: Trial, tell: Callable[[str], None]) -> list[Phase]:
    """Run the phases on a service of their own, and tell of each."""
    with tempfile.TemporaryDirectory() as folder, servers(Path(folder)) as serve:
        service = serve("service.worker", lease_s=60)
        ids = tuple(service.post(label=f"campaign {seed}", seeds=[seed], **SPEC) for seed in range(CAMPAIGNS))
        service.wait_until(lambda: all(service.get(each)["progress"]["episodes_done"] for each in ids))
        time.sleep(trial.warm_up_s)
        workers = service.workers()
        streams = Path(folder) / "streams.json"
        phases = []
        for loaded in itertools.islice(_order(), _count(trial)):
            phases.append(_phase(service, ids, workers, trial, streams, loaded))
            tell(_line(phases[-1]))
        if sorted(service.workers()) != sorted(workers):
            raise RuntimeError(f"workers were replaced, so throughput means nothing; see {service.log}")
        return phases


def _line(phase: Phase) -> str:
    """What there is to see of a phase while others follow."""
    cores = {name: getattr(phase, f"{name}_s") / phase.wall_s for name in ("workers", "server", "generator")}
    busy = ", ".join(f"{name} {share:.2f}" for name, share in cores.items())
    return f"{'loaded' if phase.loaded else 'quiet'}: {phase.steps / phase.wall_s:.0f} steps per second; cores: {busy}"


def _count(trial: Trial) -> int:
    return 2 * max(2, math.ceil(trial.seconds / trial.phase_s))


def _order() -> Iterator[bool]:
    return itertools.cycle((False, True, True, False, True, False, False, True))


def _phase(
    service: Service, ids: tuple[str, ...], workers: Sequence[int], trial: Trial, streams: Path, loaded: bool
) -> Phase:
    generator = _generator(service, ids, trial, streams) if loaded else None
    time.sleep(SETTLE_S)
    before = _reading(service, ids, workers, generator)
    with Watch(service.process.pid) as watch:
        time.sleep(trial.phase_s)
    after = _reading(service, ids, workers, generator)
    if generator is None:
        seen = {}
    else:
        said, _ = generator.communicate(timeout=60)
        seen = json.loads(said)
    return Phase(
        loaded=loaded,
        wall_s=after.at - before.at,
        steps=after.steps - before.steps,
        episodes=after.episodes - before.episodes,
        server_s=after.server_s - before.server_s,
        workers_s=after.workers_s - before.workers_s,
        generator_s=after.generator_s - before.generator_s,
        holding=watch.holding,
        seen=seen,
    )


def _generator(service: Service, ids: tuple[str, ...], trial: Trial, streams: Path) -> subprocess.Popen[bytes]:
    options = {
        "--port": service.port,
        "--pollers": trial.pollers,
        "--streams": trial.streams,
        "--seconds": trial.phase_s + SETTLE_S + 1,
        "--go-on": streams,
    }
    flags = [str(part) for option in options.items() for part in option]
    command = [sys.executable, "-m", "tests.load.generator", *flags, *ids]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE)


def _reading(
    service: Service, ids: tuple[str, ...], workers: Sequence[int], generator: subprocess.Popen[bytes] | None
) -> Reading:
    runs = [run for each in ids for run in service.get(each)["runs"]]
    return Reading(
        at=time.monotonic(),
        steps=sum(run["metrics"]["environment_steps"] for run in runs),
        episodes=sum(run["episodes_done"] for run in runs),
        server_s=processor_s(service.process.pid),
        workers_s=processor_s(*workers),
        generator_s=processor_s(generator.pid) if generator else 0.0,
    )
