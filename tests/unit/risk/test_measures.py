"""Literals by hand; the reference minimises over time by brute force."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from risk_sac.config import Requirement
from risk_sac.errors import FormulaError
from risk_sac.maps.carriageway import Carriageway
from risk_sac.risk.measures import Gauge, Measures, soft_min
from risk_sac.risk.publish import OwnMotionGauge, assess, publish
from risk_sac.risk.requirements import SIGNALS
from risk_sac.risk.rss import BEHIND_S_PER_M, DRIFT_MPS, SPEED_SHARE, WALK_MPS, time_to_encounter
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.risk.stl import ROBUSTNESS_CLIP, Monitor
from risk_sac.world.geometry import RelativeView, relative_view
from risk_sac.world.types import Frame
from tests.builders import frame_of
from tests.hostile_formulas import LONGEST, formulas

RSS = RssParameters(response_s=0.5, brake_min_mps2=6.0, brake_max_mps2=6.0)
SEEN = np.array([True])
REQUIREMENTS = (
    Requirement(name="far", formula="vehicle_gap_m >= 10", scale=10.0),
    Requirement(name="apart", formula="historically(vehicle_gap_m >= 5)", scale=10.0),
)


def gauge() -> Gauge:
    return Gauge(REQUIREMENTS, 100, RSS, softmin_sharpness=20.0)


def behind(gap_m: float) -> Frame:
    """The ego at 10 m/s, and an actor standing ahead of it."""
    return frame_of(x_m=[0.0, gap_m + 4.6], speed_mps=[10.0, 0.0])


def measured(subject: Gauge, *gaps_m: float) -> list[Measures]:
    return [subject.measure(behind(gap_m), None, SEEN) for gap_m in gaps_m]


def test_a_frame_is_measured_by_the_functions_of_the_paper():
    (measures,) = measured(gauge(), 20.0)
    assessment = assess(behind(20.0), RSS, SEEN)
    assert np.array_equal(measures.assessment.others, assessment.others)
    own = OwnMotionGauge().measure(behind(20.0))
    assert measures.signals == publish(behind(20.0), None, assessment.least, own)
    assert measures.robustness.tolist() == pytest.approx([1.0, 1.5])
    assert measures.soft_min == soft_min(measures.robustness, 20.0)


def test_an_actor_that_was_touched_in_the_step_and_is_past_has_no_gap_left():
    measures = gauge().measure(behind(0.7), None, SEEN, struck=1)
    assert measures.signals["vehicle_gap_m"] == measures.signals["ttc_s"] == measures.signals["encounter_s"] == 0.0
    assert measures.robustness.tolist() == pytest.approx([-1.0, -0.5])


def test_requirements_remember_the_frames_of_an_episode_and_nothing_before_it():
    subject = gauge()
    assert [m.robustness[1] for m in measured(subject, 20.0, 8.0, 20.0)] == pytest.approx([1.5, 0.3, 0.3])
    subject.reset(Carriageway())
    assert measured(subject, 20.0)[0].robustness[1] == pytest.approx(1.5)


Other = tuple[float, float, float, float, float]


def view_of(ego_mps: float, other: Other) -> RelativeView:
    """Ego at the origin along x; other: x, y, heading, vx, vy."""
    x, y, heading, vx, vy = np.array([(0.0, 0.0, 0.0, ego_mps, 0.0), other]).T
    frame = frame_of(x_m=x, y_m=y, heading_rad=heading, vx_mps=vx, vy_mps=vy, length_m=4.0, width_m=2.0)
    return relative_view(frame)


def encounter(ego_mps: float, other: Other, *, walks: bool = False) -> float:
    [found] = time_to_encounter(view_of(ego_mps, other), np.array([walks]))
    return float(found)


def by_brute_force(view: RelativeView, walks: bool) -> float:
    """The formula, term by term, over a fine grid of times."""
    time = np.arange(0.0, 60.0, 1e-3)
    cos, sin = view.cos[0], view.sin[0]
    normals = np.array([(1, 0), (0, 1), (cos, sin), (-sin, cos)])
    ego = math.hypot(view.ego_vx, view.ego_vy)
    other = 0.0 if walks else math.hypot(view.vx[0] + view.ego_vx, view.vy[0] + view.ego_vy)
    speeds = SPEED_SHARE * (ego * abs(normals[:, 0]) + other * abs(normals @ (cos, sin)))
    closing = (WALK_MPS if walks else DRIFT_MPS) + speeds
    apart = (view.separation[:, 0] + time[:, None] * (normals @ (view.vx[0], view.vy[0]))).__abs__()
    left = np.maximum((apart - view.reach[:, 0]) / closing, 0.0).max(axis=1)
    return float((time + left).min() + BEHIND_S_PER_M * max(-view.ego_half_length - view.x[0], 0.0))


speed, place = st.floats(0, 20), st.floats(-25, 25)
others = st.tuples(place, place, st.floats(-4, 4), st.floats(-20, 20), st.floats(-20, 20))


@settings(deadline=None, max_examples=100)  # the first call compiles
@given(speed, others, st.booleans())
def test_it_is_the_formula_s_minimum_over_time(ego_mps, other, walks):
    view = view_of(ego_mps, other)
    assert encounter(ego_mps, other, walks=walks) == pytest.approx(by_brute_force(view, walks), abs=0.15)


def test_a_leader_as_fast_as_the_ego_is_met_at_a_share_of_both_speeds():
    assert encounter(10.0, (16.0, 0, 0, 10, 0)) == pytest.approx(12 / (0.3 + 0.2 * 20))


def test_a_car_beside_the_ego_is_met_by_drifting():
    assert encounter(10.0, (0.0, 3.2, 0, 10, 0)) == pytest.approx(1.2 / 0.3)


@pytest.mark.parametrize("side", [1, -1])
def test_a_cut_in_is_seen_as_soon_as_it_begins(side):
    drifting = encounter(10.0, (0.0, side * 3.2, 0, 10, -side * 1.0))
    assert drifting == pytest.approx(1.2)  # and so before the gap has shrunk at all


def test_who_comes_from_behind_fades_out():
    beside, behind, farther = (encounter(10.0, (x, 3.2, 0, 10, 0)) for x in (-2.0, -2.5, -4.0))
    assert beside == pytest.approx(4.0)
    assert behind == pytest.approx(4.0 + 0.5 * BEHIND_S_PER_M)
    assert farther > behind


@pytest.mark.parametrize("miss_m", np.arange(0.0, 6.0, 0.05).tolist())
def test_a_near_miss_is_continuous_where_ttc_jumps(miss_m):
    """A crossing car that passes ever farther behind the ego."""
    near, farther = (encounter(10.0, (20.0, -20.0 - m, math.pi / 2, 0, 10)) for m in (miss_m, miss_m + 0.05))
    assert abs(farther - near) < 0.05


@pytest.mark.parametrize("braking_mps2", [3.0, 6.0, 9.0])
def test_an_ego_that_brakes_too_late_wins_no_time_back(braking_mps2):
    contact_mps = 3.0
    falling = []
    for speed_mps in np.arange(14.0, contact_mps, -0.25):
        gap_m = (speed_mps**2 - contact_mps**2) / (2 * braking_mps2)
        falling.append(encounter(speed_mps, (4.0 + gap_m, 0.2, 0, 0, 0)))
    assert np.all(np.diff(falling) < 0)


STEP_S, STEPS = 0.1, 200
FORMULAS = formulas()
SHARES = 8  # one test each, so that several processes can share the work


@pytest.fixture(scope="module")
def trace():
    """Any values that the signals may have."""
    generator = np.random.default_rng(0)
    return [{name: generator.uniform(info.low, info.high) for name, info in SIGNALS.items()} for _ in range(STEPS)]


def watch(formula: str, trace: list[dict[str, float]]) -> FormulaError | ValidationError | None:
    """Monitors a formula to its end; returns the error that refuses it."""
    try:
        monitor = Monitor([Requirement(name="mine", formula=formula, scale=1.0)], STEP_S, STEPS)
    except (FormulaError, ValidationError) as error:
        return error
    for signals in trace:
        [robustness] = monitor.update(signals)
        assert abs(robustness) <= ROBUSTNESS_CLIP
    return None


@pytest.mark.parametrize("share", range(SHARES))
def test_hostile_formulas_are_refused_or_watched_to_the_end(share, trace):
    refusals = [watch(formula, trace) for formula in FORMULAS[share::SHARES]]
    assert refusals.count(None) > 10
    wrong = [refusal for refusal in refusals if isinstance(refusal, FormulaError)]
    assert len(wrong) > 50
    assert all(refusal.field == "requirements[0].formula" for refusal in wrong)
    assert all(refusal.position is not None and 0 <= refusal.position <= LONGEST for refusal in wrong)
