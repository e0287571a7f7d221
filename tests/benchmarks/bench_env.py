"""Cost of the closed loop beside the simulator, and long runs."""

import gc
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import libsumo
import numpy as np
import pytest

from risk_sac.config import Scenario
from risk_sac.env.env import RiskSacEnv, make_default
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.library import VARIABLE, keep
from risk_sac.sim import drivers, paths, reading, roads, sumo

CALLERS = (sumo, sumo, roads, reading, roads, drivers, paths)  # the modules that import libsumo
STEP_RATIO = 3.5
RESET_MS = 20.0
EPISODES, ROUNDS = 8, 5
SOAK_EPISODES, GROWTH_MIB = 5000, 50.0

Call = tuple[Callable[..., object], tuple[object, ...], dict[str, object]]


class Recorder:
    """Stands before libsumo and writes down every call on its way through."""

    def __init__(self, target: object, calls: list[Call]) -> None:
        self._target, self._calls = target, calls

    def __getattr__(self, name: str) -> object:
        value = getattr(self._target, name)
        if isinstance(value, type):
            # A domain (libsumo.vehicle), or one of the exceptions.
            return value if issubclass(value, BaseException) else Recorder(value, self._calls)
        if not callable(value):
            return Recorder(value, self._calls)

        def recorded(*args: object, **kwargs: object) -> object:
            self._calls.append((value, args, kwargs))
            return value(*args, **kwargs)

        return recorded


@contextmanager
def recording(calls: list[Call]) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for module in CALLERS:
            patch.setattr(module, "libsumo", Recorder(libsumo, calls))
        yield


def actions_of(env: RiskSacEnv, seed: int, steps: int) -> list[np.ndarray]:
    """Actions that keep to a manoeuvre, as a policy's do."""
    generator, action, result = np.random.default_rng(seed), np.zeros(env.action_size), []
    for _ in range(steps):
        action = np.clip(0.95 * action + 0.3 * generator.standard_normal(env.action_size), -1, 1)
        result.append(action.astype(np.float32))
    return result


def record(env: RiskSacEnv, seed: int, actions: list[np.ndarray]) -> tuple[list[Call], list[list[Call]]]:
    """Returns an episode's libsumo calls: those of setup, and of each step."""
    calls: list[Call] = []
    with recording(calls):
        env.reset(seed=seed)
        loads = [i for i, (function, _, _) in enumerate(calls) if function is libsumo.load]
        setup = calls[loads[-1] :]  # what came before cleared up the previous episode, or rejected scenes
        steps = []
        for action in actions:
            calls.clear()
            _, _, terminated, truncated, _ = env.step(action)
            steps.append(list(calls))
            if terminated or truncated:
                break
    return setup, steps


def cpu_of_env(env: RiskSacEnv, seed: int, actions: list[np.ndarray], steps: int) -> float:
    env.reset(seed=seed)
    started = time.process_time()
    for action in actions[:steps]:
        env.step(action)
    return time.process_time() - started


def cpu_of_calls(setup: list[Call], steps: list[list[Call]]) -> float:
    """The same episode from a flat list of calls."""
    for function, args, kwargs in setup:
        function(*args, **kwargs)
    flat = [call for step in steps for call in step]
    started = time.process_time()
    for function, args, kwargs in flat:
        function(*args, **kwargs)
    return time.process_time() - started


class StepCost:
    """Processor time of some episodes' steps, and of their libsumo calls alone."""

    def __init__(self, env: RiskSacEnv) -> None:
        self._env, self._episodes = env, []
        self.ours: list[float] = []
        self.bare: list[float] = []
        self._begin()
        for seed in range(EPISODES):
            actions = actions_of(env, seed, env.problem.family.horizon_steps)
            self._episodes.append((seed, actions, *record(env, seed, actions)))

    def _begin(self) -> None:
        self._env.reset(seed=0)  # starts the simulator, so that every episode that follows begins with a load
        self._env.step(np.zeros(self._env.action_size, dtype=np.float32))  # compiles

    def measure(self) -> None:
        self._begin()
        gc.collect()
        gc.disable()
        try:
            self.ours.append(
                sum(cpu_of_env(self._env, s, actions, len(steps)) for s, actions, _, steps in self._episodes)
            )
            self.bare.append(sum(cpu_of_calls(setup, steps) for *_, setup, steps in self._episodes))
        finally:
            gc.enable()

    def ratio(self, name: str) -> float:
        """Returns the median ratio, and prints a line."""
        total = sum(len(steps) for *_, steps in self._episodes)
        calls = sum(len(step) for *_, steps in self._episodes for step in steps)
        ratios = [a / b for a, b in zip(self.ours, self.bare, strict=True)]
        ratio = statistics.median(ratios)
        print(
            f"\n{name}: env.step {min(self.ours) / total * 1e6:.0f} µs, its {calls / total:.0f} libsumo calls "
            f"{min(self.bare) / total * 1e6:.0f} µs; ratio {ratio:.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
        )
        return ratio


@pytest.mark.bench
@pytest.mark.parametrize("family", FAMILIES)
def test_a_step_costs_at_most_three_and_a_half_times_its_libsumo_calls(family: str) -> None:
    with closing(make_default(family)) as env:
        cost = StepCost(env)
        for _ in range(ROUNDS):
            cost.measure()
    assert cost.ratio(family) <= STEP_RATIO


def crowd(adversaries: int) -> Scenario:
    """Motorway with adversaries ahead of the ego, in three lanes by turns."""
    actors = {
        f"other{k}": {
            "start": {"beside": "ego", "ahead_m": f"{30 + 25 * (k // 3)} + ahead_m", "lanes_left": k % 3 - 1},
            "speed": 24,
        }
        for k in range(adversaries)
    }
    return Scenario.model_validate(
        {
            "name": f"crowd{adversaries}",
            "network": "motorway",
            "parameters": {"ahead_m": {"unit": "m", "range": [0, 20], "meaning": "how far all are moved ahead"}},
            "ego": {"start": {"lane": "main_1", "at_m": 500}, "speed": 24},
            "actors": actors,
        }
    )


@pytest.mark.bench
def test_a_step_with_twelve_adversaries_costs_no_more_times_its_libsumo_calls_than_one_with_four(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    envs = {count: make_default(keep(crowd(count), {})) for count in (2, 4, 12)}
    costs = {}
    for count, env in envs.items():
        with closing(env):
            costs[count] = StepCost(env)
    for _ in range(ROUNDS):
        for count, env in envs.items():
            with closing(env):
                costs[count].measure()
    ratios = {count: cost.ratio(f"{count} adversaries") for count, cost in costs.items()}
    assert ratios[12] <= ratios[4]


@pytest.mark.bench
@pytest.mark.parametrize("family", FAMILIES)
def test_a_reset_takes_at_most_twenty_milliseconds(family: str) -> None:
    times = []
    with closing(make_default(family)) as env:
        env.reset(seed=0)
        for seed in range(100):
            for action in actions_of(env, seed, 3):
                env.step(action)
            started = time.process_time()
            env.reset(seed=seed)
            times.append((time.process_time() - started) * 1e3)
    worst = sorted(times)[94]
    print(f"\n{family}: reset {statistics.median(times):.1f} ms, 95 % within {worst:.1f} ms")
    assert statistics.median(times) <= RESET_MS


@pytest.mark.bench
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("family", FAMILIES)
def test_five_thousand_biased_episodes_neither_crash_nor_leak(family: str) -> None:
    started = time.perf_counter()
    command = [sys.executable, "-m", "tests.soak", family, str(SOAK_EPISODES)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    print(f"\n{SOAK_EPISODES} {family} episodes in {time.perf_counter() - started:.0f} s: {done.stdout.strip()}")
    grew = re.match(r"grew (-?[\d.]+) MiB", done.stdout)
    assert grew
    assert float(grew[1]) < GROWTH_MIB
