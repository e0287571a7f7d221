"""Stories played with SUMO's ego, in the environment."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from risk_sac.config import DeviationBounds, RewardConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import InfeasibleScene
from risk_sac.scenario import library
from risk_sac.scenario.families import family_of
from risk_sac.scenario.reading import document_from, nets_of
from risk_sac.world.types import Frame, Role, Scene

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
BRAKING = """
name: story_braking
network: motorway
horizon_s: 20
parameters: {gap_m: {unit: m, range: [0.2, 60]}}
ego: {start: {lane: main_1, at_m: 300}, speed: 25}
actors:
  lead: {role: story, start: {ahead_of: ego, gap_m: gap_m}, speed: 25}
  left: {role: story, start: {beside: lead, ahead_m: 0, lanes_left: 1}, speed: 25}
  right: {role: story, start: {beside: lead, ahead_m: 0, lanes_left: -1}, speed: 25}
  walker: {role: story, body: pedestrian, start: {x_m: 700, y_m: -20, heading_deg: 90}, speed: 1}
story:
  stories:
    braking:
      - groups:
          - actors: [lead, left, right]
            maneuvers:
              - events:
                  - name: brake
                    start: [[{kind: time, rule: greater_or_equal, value: 2}]]
                    actions:
                      - name: brake
                        do: {kind: speed, target: 0, dynamics: {shape: linear, by: rate, value: 5}}
      - groups:
          - actors: [walker]
            maneuvers:
              - events:
                  - name: leave
                    start: [[{kind: time, rule: greater_or_equal, value: 3}]]
                    actions: [{do: {kind: delete}}]
"""
CAR_M = 4.6


def environment(text: str, method: str = "no-adversary", **spec: Any) -> RiskSacEnv:
    document = document_from(text)
    family = family_of(document, nets_of(document))
    run = RunSpec(family="low", method=method, seed=0, **spec)
    return RiskSacEnv(Problem.from_spec(run, family), RewardConfig(), controlled=method != "no-adversary")


def played(env: RiskSacEnv, values: Mapping[str, float], action: Sequence[float] | None = None) -> list[Frame]:
    env.reset(seed=1, options={"scene": Scene(env.problem.family.name, values)})
    shares = np.zeros(env.action_size) if action is None else np.array(action)
    over = False
    while not over:
        _, _, terminated, truncated, _ = env.step(shares.astype(np.float32))
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


def braking_env(ego: str, method: str = "no-adversary", text: str = BRAKING) -> RiskSacEnv:
    return environment(text, method, **({} if ego == "default" else {"ego": {"driver": ego}}))


@pytest.mark.parametrize("ego", ["default", "idm-aeb"])
def test_ego_stops_behind_a_story_vehicle(ego: str) -> None:
    env = braking_env(ego)
    frames = played(env, {"gap_m": 50.0})
    env.close()
    assert len(frames) - 1 == env.layout.horizon_steps  # no contact
    last = frames[-1]
    assert of(last, "lead")["speed_mps"] == 0.0
    assert of(last, "ego")["speed_mps"] < 0.5
    gap_m = of(last, "lead")["x_m"] - of(last, "ego")["x_m"] - CAR_M
    assert 0.5 < gap_m < 15.0
    travelled = 25.0 * 2.0 + 25.0**2 / (2 * 5.0)
    assert of(last, "lead")["x_m"] - of(frames[0], "lead")["x_m"] == pytest.approx(travelled, abs=0.05)


def test_story_begins_with_the_release_and_free_actors_walk() -> None:
    env = braking_env("default")
    frames = played(env, {"gap_m": 50.0})
    env.close()
    assert env.trace.released == 0
    assert of(frames[20], "walker")["y_m"] == pytest.approx(-18.0)
    assert "walker" in frames[29].ids
    assert "walker" not in frames[31].ids
    assert all(frame.role[frame.ids.index("lead")] == Role.STORY for frame in frames)


def test_shifted_trigger_is_a_parameter_of_methods_that_deviate() -> None:
    text = BRAKING.replace("horizon_s: 20", "horizon_s: 4")
    controlled, written = braking_env("default", "random", text), braking_env("default", text=text)
    assert written.problem.space.names == ("gap_m",)
    assert controlled.problem.space.names == ("gap_m", "trigger_shift_lead")
    bounds = controlled.problem.space.parameters[1]
    assert (bounds.low, bounds.high) == (-0.5, 0.5)
    braking = {}
    for shift_s in (-0.5, 0.0, 0.5):
        frames = played(controlled, {"gap_m": 50.0, "trigger_shift_lead": shift_s})
        braking[shift_s] = next(i for i, frame in enumerate(frames) if of(frame, "lead")["speed_mps"] < 24.99)
        assert frames[-1].role.tolist()[1] == (Role.ADVERSARY if shift_s else Role.STORY)
        assert controlled.deviations.keys() == ({"lead", "left", "right"} if shift_s else set())
    controlled.close()
    written.close()
    assert {shift_s: step - braking[0.0] for shift_s, step in braking.items()} == {-0.5: -5, 0.0: 0, 0.5: 5}


def test_dangerous_start_is_reported_and_played_and_an_overlap_is_refused() -> None:
    env = braking_env("default")
    env.reset(seed=1, options={"scene": Scene(env.problem.family.name, {"gap_m": 0.3})})
    assert env.start_danger == "initial_gap"
    env.close()
    overlapping = braking_env("default", text=BRAKING.replace("range: [0.2, 60]", "range: [-4, 60]"))
    with pytest.raises(InfeasibleScene, match="initial_overlap"):
        overlapping.reset(seed=1, options={"scene": Scene(overlapping.problem.family.name, {"gap_m": -2.0})})
    overlapping.close()


def test_zero_action_plays_the_story_and_an_action_leads_away_from_it() -> None:
    text = BRAKING.replace("horizon_s: 20", "horizon_s: 4").replace(
        "story:\n", "story:\n  deviation: {trigger_s: 0}\n", 1
    )
    controlled, written = braking_env("default", "random", text), braking_env("default", text=text)
    size = controlled.action_size
    assert size == 8
    runs = [played(written, {"gap_m": 50.0}, [0.0] * size)]
    written.close()
    runs += [played(controlled, {"gap_m": 50.0}, action) for action in ([0.0] * size, [-1.0, 1.0] + [0.0] * 6)]
    as_written, still, led = runs
    assert [of(frame, "lead") for frame in as_written] == [of(frame, "lead") for frame in still]
    assert still[-1].role.tolist() == [Role.EGO, Role.STORY, Role.STORY, Role.STORY]
    assert led[-1].role.tolist() == [Role.EGO, Role.ADVERSARY, Role.STORY, Role.STORY]
    assert of(led[20], "lead")["speed_mps"] == pytest.approx(25.0 - 1.5 * 2.0, abs=0.5)
    assert of(led[20], "lead")["lateral_mps"] == pytest.approx(0.5, abs=0.01)
    series = controlled.trace.series()
    assert series["role"].tolist()[:2] == [Role.EGO, Role.ADVERSARY]
    scene = Scene(controlled.problem.family.name, {"gap_m": 50.0})
    controlled.reset(seed=1, options={"scene": scene, "motions": series})
    for frame in led[1:]:
        controlled.step(np.zeros(size, dtype=np.float32))
        assert of(controlled.trace.frames[-1], "lead") == of(frame, "lead")
    controlled.close()


def test_a_campaigns_bounds_of_deviations_take_the_place_of_the_documents(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RISK_SAC_PLACES", str(tmp_path))
    name = library.keep(document_from(BRAKING), {})
    bounds = {"accel_mps2": 0.0, "lateral_mps": 0.0}
    posed = {
        shift_s: Problem.from_spec(
            RunSpec(family=name, method="random", seed=0, deviation=DeviationBounds(**bounds, trigger_s=shift_s))
        )
        for shift_s in (0.0, 2.0)
    }
    assert posed[2.0].space.parameters[-1].high == 2.0
    assert posed[2.0].action_size == 8
    assert (posed[0.0].space.names, posed[0.0].action_size) == (("gap_m",), 0)
