import math

import numpy as np
import pytest

from risk_sac.risk.publish import (
    CROSSED_ON_RED_M,
    ENCOUNTER,
    RED_LIGHT_BRAKING_CAP_MPS2,
    RSS_SCALED,
    TTC,
    LeastMargins,
    OwnMotion,
    assess,
    in_charge,
    least_margins,
    publish,
    red_light_braking,
    red_light_margin,
)
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import Frame, Kind, Signal
from tests import builders

VEHICLE, PEDESTRIAN = Kind.VEHICLE, Kind.PEDESTRIAN
OWN = OwnMotion(
    ego_jerk_mps3=1.0,
    ego_lateral_accel_mps2=2.0,
    lane_offset_m=3.0,
    over_limit_mps=4.0,
    edge_m=-5.0,
    carriageway_m=-6.0,
    headway_s=7.0,
)


def frame_of(
    *others: tuple[float, float, Kind], speed_mps: float = 10.0, accel_mps2: float = 0.0, stop_line_m: float = math.inf
) -> Frame:
    """Ego of 4 m at the origin; others stand: x, y, kind."""
    rest = [0.0] * len(others)
    return builders.frame_of(
        [VEHICLE, *(kind for _, _, kind in others)],
        x_m=[0.0, *(x for x, _, _ in others)],
        y_m=[0.0, *(y for _, y, _ in others)],
        speed_mps=[speed_mps, *rest],
        accel_mps2=[accel_mps2, *rest],
        length_m=4.0,
        width_m=2.0,
        signal=Signal.NONE if math.isinf(stop_line_m) else Signal.RED,
        stop_line_m=stop_line_m,
    )


def signals_of(
    frame: Frame, ttc: list[float], rss: list[float], encounter: list[float] | None = None
) -> dict[str, float]:
    others = assess(frame, RssParameters(), np.ones(len(frame.ids) - 1, dtype=np.bool_)).others.copy()
    others[TTC], others[RSS_SCALED], others[ENCOUNTER] = ttc, rss, ttc if encounter is None else encounter
    return publish(frame, None, LeastMargins(*least_margins(others, frame.kind)), OWN)


@pytest.mark.parametrize(
    ("x_m", "y_m", "charged"),
    [(20, 0, True), (0, 3, True), (-1.9, 3, True), (-2.1, 3, False), (-20, 0, False), (5, -40, True)],
)
def test_the_ego_answers_for_whoever_is_not_behind_its_rear_bumper(x_m, y_m, charged):
    assert in_charge(relative_view(frame_of((x_m, y_m, VEHICLE)))).tolist() == [charged]


def test_the_least_value_among_those_in_charge_is_published():
    frame = frame_of((30, 0, VEHICLE), (50, 3, VEHICLE), (-20, 0, VEHICLE))
    published = signals_of(frame, [4.0, 2.5, 0.5], [0.3, -0.2, -2.0], [3.5, 2.4, 7.0])
    assert published["encounter_s"] == 2.4  # in which the tailgater's counts, faded out by its own measure
    assert published["ttc_s"] == 2.5  # the tailgater's 0.5 s does not count
    assert published["rss_margin"] == -0.2


def test_gaps_count_in_every_direction_and_by_kind():
    frame = frame_of((-9, 0, VEHICLE), (20, 0, VEHICLE), (0, -8, PEDESTRIAN))
    published = signals_of(frame, [9.0] * 3, [2.0] * 3)
    assert published["vehicle_gap_m"] == pytest.approx(5.0)
    assert published["pedestrian_gap_m"] == pytest.approx(6.0)


def at_light(signal: Signal, stop_line_m: float) -> Frame:
    return frame_of()._replace(signal=signal, stop_line_m=stop_line_m)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        pytest.param(at_light(Signal.RED, 0.4), at_light(Signal.NONE, math.inf), id="no further signal"),
        pytest.param(at_light(Signal.RED, 0.4), at_light(Signal.GREEN, 310.0), id="the next signal is green"),
        pytest.param(at_light(Signal.RED, 0.4), at_light(Signal.RED, 310.0), id="the next signal is red"),
        pytest.param(at_light(Signal.RED, 1.3), at_light(Signal.NONE, math.inf), id="at 13 m/s"),
    ],
)
def test_passing_the_stop_line_on_red_is_negative(before, after):
    assert red_light_margin(after, before) == CROSSED_ON_RED_M < 0
    assert red_light_braking(after, before) == RED_LIGHT_BRAKING_CAP_MPS2


@pytest.mark.parametrize(
    ("before", "after"),
    [
        pytest.param(at_light(Signal.GREEN, 0.4), at_light(Signal.NONE, math.inf), id="crossed on green"),
        pytest.param(at_light(Signal.YELLOW, 0.4), at_light(Signal.NONE, math.inf), id="crossed on yellow"),
        pytest.param(at_light(Signal.RED, 5.0), at_light(Signal.GREEN, 4.5), id="red turns green while it approaches"),
        pytest.param(at_light(Signal.RED, 0.2), at_light(Signal.GREEN, 0.2), id="red turns green while it waits"),
        pytest.param(at_light(Signal.NONE, math.inf), at_light(Signal.GREEN, 90.0), id="a signal comes into view"),
    ],
)
def test_no_red_light_was_run(before, after):
    assert red_light_margin(after, before) >= 0
    assert red_light_braking(after, before) < RED_LIGHT_BRAKING_CAP_MPS2


@pytest.mark.parametrize(
    ("signal", "speed_mps", "stop_line_m", "braking_mps2"),
    [
        (Signal.RED, 10.0, 12.0, 4.0),  # 10² / (2 · 12.5)
        (Signal.RED, 10.0, 2.0, RED_LIGHT_BRAKING_CAP_MPS2),
        (Signal.RED, 0.0, 0.0, 0.0),  # waits at the line
        (Signal.RED, 1.0, 0.0, 1.0),  # creeps up to it
        (Signal.GREEN, 10.0, 2.0, 0.0),
        (Signal.YELLOW, 10.0, 2.0, 0.0),
    ],
)
def test_braking_for_a_red_light(signal, speed_mps, stop_line_m, braking_mps2):
    frame = frame_of(speed_mps=speed_mps)._replace(signal=signal, stop_line_m=stop_line_m)
    assert red_light_braking(frame, None) == pytest.approx(braking_mps2)
