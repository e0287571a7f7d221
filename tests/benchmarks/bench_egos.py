"""What a step costs with an ego that drives itself, against SUMO's driver: interleaved, as ratios and milliseconds.

The promise: an ego in our process at most 20 % over SUMO's, what it thinks itself apart (`lane-keeper` hardly does); a
remote one on loopback at most 0.5 ms more than the same ego in our process. Ratios are of processor time, loopback of
real time.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import numpy as np
import pytest

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.egos.registry import SHIPPED
from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene
from tests.egos import served

ROUNDS, EPISODES = 5, 2


@contextmanager
def registered(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Iterator[None]:
    with served("idm-aeb", folder) as table:
        file = folder / "egos.toml"
        file.write_text(f"[far]\n{table}")
        monkeypatch.setenv("RISK_SAC_EGOS", str(file))
        yield


def ms_per_step(env: RiskSacEnv, seed: int) -> tuple[float, float]:
    """Of whole episodes with random actions, without their beginnings: processor time and real time."""
    rng, cpu, real, steps = np.random.default_rng(seed), 0.0, 0.0, 0
    for episode in range(EPISODES):
        try:
            env.reset(seed=seed * EPISODES + episode)
        except InfeasibleScene:
            continue
        ended = False
        while not ended:
            action = rng.uniform(-0.2, 0.2, env.action_size).astype(np.float32)
            began_cpu, began = process_time(), perf_counter()
            _, _, terminated, truncated, _ = env.step(action)
            cpu, real = cpu + process_time() - began_cpu, real + perf_counter() - began
            steps, ended = steps + 1, terminated or truncated
    return 1000 * cpu / steps, 1000 * real / steps


@pytest.mark.bench
@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_cost_of_a_step(family: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    egos = {
        "sumo": EgoConfig(),
        **{name: EgoConfig(driver=name) for name in ("lane-keeper", "idm-aeb", "r157", "rss", "broken", "far")},
    }
    monkeypatch.setitem(SHIPPED, "lane-keeper", "tests.egos:LaneKeeper")
    with registered(monkeypatch, tmp_path):
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in egos}
        for round_ in range(-1, ROUNDS):  # the first warms up
            for name, ego in egos.items():
                spec = RunSpec(family=family, method="random", seed=0, ego=ego)
                with closing(RiskSacEnv.of(spec)) as env:
                    took = ms_per_step(env, round_ + 1)
                if round_ >= 0:
                    times[name].append(took)
    print()
    sumo = [cpu for cpu, _ in times["sumo"]]
    for name, took in times.items():
        cpu = [each for each, _ in took]
        ratio = median(each / other for each, other in zip(cpu, sumo, strict=True))
        print(f"{family}: a step with {name} takes {median(cpu):.3f} ms, {ratio:.2f} of SUMO's")
    extra = median(far - near for (_, far), (_, near) in zip(times["far"], times["idm-aeb"], strict=True))
    print(f"{family}: loopback takes {extra:.3f} ms of a step")
