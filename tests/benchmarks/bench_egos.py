"""Cost of a step with registered egos, relative to SUMO's driver, interleaved.

The promise: an ego in our process at most 20 % over SUMO's, what it thinks itself apart; a remote one on loopback at
most 0.5 ms more than the same ego in our process, if it is compiled: in Python a bare echo by gRPC takes nearly all of
that. Ratios are of processor time, loopback of real time; of the example in C++, where it can be compiled, it is what a
step takes more than one with `idm-aeb` in our process.

`shadow` hardly thinks, and drives as fast as SUMO's driver did in the same episode, so that both have as much going on
around them. A step that ends in a contact is left out: to judge it takes milliseconds, and a bad driver has more.
"""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import numpy as np
import pytest

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.egos.registry import SHIPPED
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene
from risk_sac.scenario.layout import LEAD_IN_S
from risk_sac.world.types import STEP_S
from tests.ego_processes import CPP_COMPILES, Shadow, served, served_by_cpp

ROUNDS = 16
Took = tuple[float, float]  # ms of processor time and of real time


@contextmanager
def registered(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Iterator[None]:
    with ExitStack() as stack:
        tables = {"far": stack.enter_context(served("idm-aeb", folder))}
        if CPP_COMPILES:
            (folder / "cpp").mkdir()
            tables["far-cpp"] = stack.enter_context(served_by_cpp(folder / "cpp"))
        file = folder / "egos.toml"
        file.write_text("".join(f"[{name}]\n{table}" for name, table in tables.items()))
        monkeypatch.setenv("RISK_SAC_EGOS", str(file))
        yield


def ms_per_step(env: RiskSacEnv, seed: int) -> Took | None:
    """Times an episode without begin and contact; None if refused."""
    rng, cpu, real, steps = np.random.default_rng(seed), 0.0, 0.0, 0
    try:
        env.reset(seed=seed)
    except InfeasibleScene:
        return None
    ended = False
    while not ended:
        action = rng.uniform(-0.2, 0.2, env.action_size).astype(np.float32)
        began_cpu, began = process_time(), perf_counter()
        _, _, terminated, truncated, _ = env.step(action)
        took_cpu, took = process_time() - began_cpu, perf_counter() - began
        ended = terminated or truncated
        if not terminated:
            cpu, real, steps = cpu + took_cpu, real + took, steps + 1
    return (1000 * cpu / steps, 1000 * real / steps) if steps else None


def driven(env: RiskSacEnv) -> list[float]:
    """The ego's speeds since the release."""
    return [float(frame.speed_mps[0]) for frame in env.trace.frames[1 + round(LEAD_IN_S / STEP_S) :]]


@pytest.mark.bench
@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_cost_of_a_step(family: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    far = ("far", "far-cpp") if CPP_COMPILES else ("far",)
    egos = {
        "sumo": EgoConfig(),
        **{name: EgoConfig(driver=name) for name in ("shadow", "idm-aeb", "r157", "rss", "broken", *far)},
    }
    monkeypatch.setitem(SHIPPED, "shadow", "tests.ego_processes:Shadow")
    times: dict[str, list[Took]] = {name: [] for name in egos}
    with registered(monkeypatch, tmp_path):
        for seed in range(ROUNDS + 1):  # the first warms up
            took: dict[str, Took | None] = {}
            for name, ego in egos.items():
                with closing(RiskSacEnv.of(RunSpec(family=family, method="random", seed=0, ego=ego))) as env:
                    took[name] = ms_per_step(env, seed)
                    if name == "sumo" and took[name]:
                        Shadow.speeds_mps = driven(env)
            if seed and all(took.values()):
                for name, each in took.items():
                    times[name].append(each)
    print()
    sumo = [cpu for cpu, _ in times["sumo"]]
    for name, each in times.items():
        cpu = [ms for ms, _ in each]
        ratio = median(ms / other for ms, other in zip(cpu, sumo, strict=True))
        print(f"{family}: a step with {name} takes {median(cpu):.3f} ms, {ratio:.2f} of SUMO's ({len(each)} episodes)")
    for name in far:
        extra = median(one - near for (_, one), (_, near) in zip(times[name], times["idm-aeb"], strict=True))
        print(f"{family}: loopback to {name} takes {extra:.3f} ms of a step")
