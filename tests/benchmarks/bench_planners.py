"""Cost of a planner's step: processor time of `act` and package `step()`.

Random search plays 8 episodes of each family. A step without a plan is one that the package reports as degraded,
fallback or emergency.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from time import process_time

import numpy as np
import pytest

fp = pytest.importorskip("fiss_planner")

from risk_sac.config import EgoConfig, RunSpec  # noqa: E402
from risk_sac.egos.planners.fiss import FissPlus  # noqa: E402
from risk_sac.egos.seam import Control, Perceived  # noqa: E402
from risk_sac.env.env import RiskSacEnv  # noqa: E402
from risk_sac.errors import InfeasibleScene  # noqa: E402

EPISODES = 8
WANTED_MS = 3.0  # mean of `act`


class Times:
    """Milliseconds of each `act`, and of the package's steps with(out) a plan."""

    def __init__(self) -> None:
        self.act: list[float] = []
        self.step: dict[bool, list[float]] = {True: [], False: []}


@contextmanager
def measured(monkeypatch: pytest.MonkeyPatch) -> Iterator[Times]:
    """Measures the planner while it lasts."""
    times, act, planner = Times(), FissPlus.act, fp.LocalPlanner

    class Measured:
        def __init__(self, *given: object) -> None:
            self._planner = planner(*given)
            self.set_map = self._planner.set_map
            self.set_stop_line_active = self._planner.set_stop_line_active

        def step(self, *given: object) -> object:
            began = process_time()
            plan = self._planner.step(*given)
            took = process_time() - began
            times.step[not (plan.degraded or plan.fallback or plan.emergency)].append(1000 * took)
            return plan

    def measured_act(self: FissPlus, perceived: Perceived) -> Control:
        began = process_time()
        control = act(self, perceived)
        times.act.append(1000 * (process_time() - began))
        return control

    with monkeypatch.context() as patched:
        patched.setattr(fp, "LocalPlanner", Measured)
        patched.setattr(FissPlus, "act", measured_act)
        yield times


def play(env: RiskSacEnv, seed: int) -> bool:
    """Plays an episode with random actions; False if its scene is refused."""
    rng = np.random.default_rng(seed)
    try:
        env.reset(seed=seed)
    except InfeasibleScene:
        return False
    ended = False
    while not ended:
        *_, terminated, truncated, _ = env.step(rng.uniform(-1.0, 1.0, env.action_size).astype(np.float32))
        ended = terminated or truncated
    return True


@pytest.mark.bench
@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_cost_of_a_plan(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = RunSpec(family=family, method="random", seed=0, ego=EgoConfig(driver="fiss-plus"))
    with closing(RiskSacEnv.of(spec)) as env:
        play(env, seed := 0)  # warms up
        with measured(monkeypatch) as times:
            played = 0
            while played < EPISODES:
                seed += 1
                played += play(env, seed)
    act, planned, other = np.array(times.act), np.array(times.step[True]), np.array(times.step[False])
    own = (planned.sum() + other.sum()) / act.sum()
    print(
        f"\n{family}: act {act.mean():.1f} ms, 95th percentile {np.quantile(act, 0.95):.0f} ms; step() with a plan "
        f"{planned.mean():.1f} ms, without {other.mean():.1f} ms in {len(other) / len(act):.0%} of {len(act)} steps; "
        f"step() is {own:.0%} of act"
    )
    assert act.mean() <= WANTED_MS
