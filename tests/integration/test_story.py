"""Stories played with SUMO's ego, in the environment."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest

from risk_sac.config import RewardConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.scenario.families import family_of
from risk_sac.scenario.reading import document_from
from risk_sac.scenario.shipped import nets_of
from risk_sac.world.types import Frame, Scene

CUT_IN = """
name: story_cut_in
network: motorway
horizon_s: 20
parameters:
  side: {rows: [{lanes: 1, lane_y: 3.5}, {lanes: -1, lane_y: -3.5}]}
  gap_m: {unit: m, range: [20, 40]}
ego: {start: {lane: main_1, at_m: 300}, speed: 30}
actors:
  cutter: {role: story, start: {beside: ego, ahead_m: 60, lanes_left: lanes}, speed: 20}
story:
  stories:
    cut_in:
      - groups:
          - actors: [cutter]
            maneuvers:
              - events:
                  - name: cut
                    start:
                      - - {kind: distance, of: [ego], to: cutter, rule: less, value: gap_m, along: longitudinal,
                           freespace: true, edge: rising}
                    actions:
                      - name: change
                        do:
                          kind: lane_change
                          target: {to: ego, lanes: 0}
                          dynamics: {shape: sinusoidal, by: rate, value: 1.5}
  stop:
    - - {kind: state, element: change, of_kind: action, state: complete, edge: rising, delay_s: 3}
"""
CAR_M = 4.6


def environment(text: str, method: str = "no-adversary", **spec: Any) -> RiskSacEnv:
    document = document_from(text)
    family = family_of(document, nets_of(document))
    run = RunSpec(family="low", method=method, seed=0, **spec)
    return RiskSacEnv(Problem.from_spec(run, family), RewardConfig(), controlled=method != "no-adversary")


def played(env: RiskSacEnv, values: Mapping[str, float], action: Sequence[float] = (0.0, 0.0)) -> list[Frame]:
    env.reset(seed=1, options={"scene": Scene(env.problem.family.name, values)})
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(np.array(action, dtype=np.float32))
        over = terminated or truncated
    return list(env.trace.frames)


def of(frame: Frame, name: str) -> dict[str, float]:
    column = frame.ids.index(name)
    return {
        field: float(getattr(frame, field)[column])
        for field in ("x_m", "y_m", "heading_rad", "speed_mps", "lateral_mps", "accel_mps2")
    }


@pytest.mark.parametrize(("side", "from_y_m"), [(0.25, 3.5), (0.75, -3.5)])
def test_cut_in_is_the_one_of_its_document(side: float, from_y_m: float) -> None:
    env = environment(CUT_IN)
    frames = played(env, {"side": side, "gap_m": 30.0})
    env.close()
    begins_m = float(frames[0].x_m[1])
    assert begins_m == pytest.approx(300 - CAR_M / 2 + 60, abs=0.01)
    gaps_m = [float(frame.x_m[1] - frame.x_m[0]) - CAR_M for frame in frames]
    trigger = next(step for step, gap_m in enumerate(gaps_m) if gap_m < 30.0)
    lasts_s = math.pi * 3.5 / (2 * 1.5)  # the largest lateral speed of a sinusoid is π d / 2 T
    for step, frame in enumerate(frames):
        share = min(max((step - trigger) * 0.1 / lasts_s, 0.0), 1.0)
        cutter = of(frame, "cutter")
        rear_axle_y = from_y_m * (1 + math.cos(math.pi * share)) / 2
        assert cutter["y_m"] == pytest.approx(rear_axle_y, abs=0.01)
        assert cutter["x_m"] == pytest.approx(begins_m + 2.0 * step, abs=0.01)
        assert cutter["speed_mps"] == pytest.approx(20.0, abs=1e-6)
        lateral = -from_y_m * math.pi / 2 / lasts_s * math.sin(math.pi * share)
        assert cutter["lateral_mps"] == pytest.approx(lateral, abs=0.1)
    ends = trigger + math.ceil(lasts_s / 0.1)
    assert len(frames) - 1 == ends + 30  # three seconds after the change
