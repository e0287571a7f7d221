"""Scenarios played as written: the whole grid, a sample, or a search."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from risk_sac.config import Budget, EgoConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem, adjustments
from risk_sac.errors import ConfigError
from risk_sac.metrics import results_digest
from risk_sac.records import EpisodeRecord, Outcome, PlausibilityClass
from risk_sac.scenario.library import VARIABLE, keep
from risk_sac.scenario.reading import document_from
from risk_sac.search.loop import execute_run
from risk_sac.world.types import Scene
from tests.listener import Listener

CUT_IN = """
name: swept_cut_in
network: motorway
horizon_s: 9
set_speed: 25
parameters:
  side: {rows: [{lanes: 1}, {lanes: -1}]}
  gap_m: {unit: m, range: [6, 46], step: 20}
  slower_mps: {unit: m/s, range: [5, 15], step: 10}
ego: {start: {lane: main_1, at_m: 300}, speed: 25}
actors:
  cutter: {role: story, start: {beside: ego, ahead_m: gap_m + 15, lanes_left: lanes}, speed: 25 - slower_mps}
constraints: [gap_m + slower_mps < 61]
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
                          dynamics: {shape: linear, by: rate, value: 1.6}
"""
POINTS, REFUSED = 2 * 3 * 2, 2


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, str(tmp_path_factory.mktemp("places")))
        yield keep(document_from(CUT_IN), {})


def spec(family: str, method: str = "story-sweep", episodes: int = 50, **changes: Any) -> RunSpec:
    return RunSpec(family=family, method=method, seed=3, budget=Budget(episodes=episodes), **changes)


def played(folder: Path, wanted: RunSpec) -> list[EpisodeRecord]:
    listener = Listener()
    assert execute_run(wanted, folder, listener).finished
    return listener.records


@pytest.fixture(scope="module")
def sweep(family, tmp_path_factory):
    return played(tmp_path_factory.mktemp("sweep"), spec(family))


def test_a_sweep_plays_each_point_once_and_counts_those_refused(sweep):
    points = [tuple(record.scene.values()) for record in sweep]
    assert points == [(u, gap, slower) for u in (0.25, 0.75) for gap in (6, 26, 46) for slower in (5, 15)]
    refused = [record for record in sweep if record.outcome is Outcome.REJECTED]
    assert [(record.reason, record.scene["gap_m"], record.steps) for record in refused] == [("constraint", 46, 0)] * 2
    assert len(sweep) - len(refused) == POINTS - REFUSED


def test_both_sides_of_the_road_have_the_same_verdicts(sweep):
    """Except the smallest gap, where SUMO's driver falls behind on one side."""
    left, right = ([r.avoided_by for r in half if r.scene["gap_m"] > 6] for half in (sweep[:6], sweep[6:]))
    assert left == right
    assert {told["r157"] for told in left if told is not None} == {True, False}


def test_failures_as_written_are_ordinary_behaviour(sweep):
    struck = [record.collision for record in sweep if record.collision is not None and record.collision.valid]
    assert struck
    assert {contact.behaviour.verdict for contact in struck} == {PlausibilityClass.ORDINARY}
    assert not any(record.deviations for record in sweep)


def test_a_sweep_that_was_interrupted_goes_on_where_it_ended(family, sweep, tmp_path):
    assert not execute_run(spec(family), tmp_path, Listener(limit=5)).finished
    assert results_digest(played(tmp_path, spec(family))) == results_digest(sweep)


def test_a_sample_is_part_of_the_grid(family, sweep, tmp_path):
    sample = [tuple(record.scene.values()) for record in played(tmp_path, spec(family, episodes=4))]
    assert len(set(sample)) == 4
    assert set(sample) < {tuple(record.scene.values()) for record in sweep}
    told = {each.field: each.used for each in adjustments(spec(family, episodes=4))}
    assert told == {"budget.episodes": "4 of them"}


def test_all_points_of_a_larger_grid_are_refused(family):
    wanted = spec(family).model_copy(update={"budget": Budget(episodes=11, all_points=True)})
    with pytest.raises(ConfigError) as caught:
        Problem.from_spec(wanted)
    assert caught.value.field == "budget.all_points"
    assert "12 points" in caught.value.got
    Problem.from_spec(wanted.model_copy(update={"budget": Budget(episodes=12, all_points=True)}))


@pytest.mark.parametrize("method", ["story-random", "story-bo"])
def test_a_search_of_the_parameters_keeps_the_constraints_and_attacks_with_nothing(family, tmp_path, method):
    records = played(tmp_path, spec(family, method, episodes=4))
    assert {record.outcome for record in records} <= {Outcome.SAFE, Outcome.FAILURE, Outcome.DEGENERATE}
    assert {record.driven_by for record in records} == {None}
    assert all(record.avoided_by is not None for record in records)
    assert not any(record.deviations for record in records)


@pytest.mark.parametrize("driver", [None, "idm-aeb"])
def test_an_ego_keeps_the_speed_and_the_lane_that_it_is_told(family, driver):
    """The motorway's limit is higher, and the next lane is faster."""
    env = RiskSacEnv.of(spec(family, ego=EgoConfig(driver=driver)))
    env.reset(seed=0, options={"scene": Scene(family, {"side": 0.25, "gap_m": 26.0, "slower_mps": 5.0})})
    over = False
    while not over:
        _, _, ended, truncated, _ = env.step(np.zeros(env.action_size, dtype=np.float32))
        over = ended or truncated
    series = env.trace.series()
    env.close()
    assert series["speed_mps"][:, 0].max() <= 25.2
    assert np.ptp(series["y_m"][:, 0]) < 0.5
