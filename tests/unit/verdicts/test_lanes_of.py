"""Limit and width of a body's lane, on nets whose lanes differ."""

import numpy as np
import pytest

from risk_sac.verdicts.evidence import Evidence, Ground, lanes_of
from risk_sac.verdicts.offences import speeds, striker_offences
from tests.unit.verdicts.staged import stage, straight

ON_RAMP, WEAVING = (500.0, -14.8, 0.14), (700.0, -8.75, 0.0)
RAMP = Ground(speed_limit_mps=13.89, lane_width_m=3.3, net="motorway_ramp/motorway_ramp.net.xml")
RURAL = Ground(net="rural/rural.net.xml")
ROUNDABOUT = Ground(net="roundabout/roundabout.net.xml")


def drives(x: float, y: float, heading: float, speed: float, ground: Ground) -> Evidence:
    """Half a second of an ego at a place, others far away."""
    ego = straight(x, y, heading, speed, start_s=0.0)
    return stage(ego, straight(0.0, 500.0, 0.0, 10.0), ground=ground, from_s=0.0, until_s=0.5, contact=False)


@pytest.mark.parametrize(
    ("place", "ground", "limit_mps", "width_m"),
    [
        pytest.param(ON_RAMP, RAMP, 22.22, 3.5, id="ramp"),
        pytest.param(WEAVING, RAMP, 36.0, 3.5, id="acceleration lane"),
        pytest.param((0.0, -15.5, 0.0), ROUNDABOUT, 6.94, 4.5, id="ring"),
        pytest.param((1.75, -150.0, np.pi / 2), ROUNDABOUT, 13.89, 3.5, id="arm"),
        pytest.param((0.0, 0.0, 0.0), Ground(speed_limit_mps=9.0, lane_width_m=3.0), 9.0, 3.0, id="no net"),
    ],
)
def test_limit_and_width_are_those_of_the_lane(place, ground, limit_mps, width_m):
    lanes = lanes_of(drives(*place, 5.0, ground), 0)
    assert lanes.limit_mps == pytest.approx(np.full(6, limit_mps))
    assert lanes.width_m == pytest.approx(np.full(6, width_m))


@pytest.mark.parametrize(("place", "broke"), [(ON_RAMP, True), (WEAVING, False)])
def test_a_speed_that_a_motorway_allows_is_speeding_on_its_ramp(place, broke):
    ego = straight(0.0, 500.0, 0.0, 10.0)
    other = straight(*place, 30.0, start_s=0.0)
    evidence = stage(ego, other, ground=RAMP, from_s=0.0, until_s=0.5, contact=False)
    assert speeds(evidence, 1) is broke


@pytest.mark.parametrize(("y", "heading"), [(1.75, 0.0), (-1.75, np.pi)])
@pytest.mark.parametrize("wrong", [True, False])
def test_a_striker_on_the_oncoming_lane_drives_in_the_wrong_direction(y, heading, wrong):
    y = y if wrong else -y
    ego = straight(1000.0 + 40.0 * np.cos(heading), y, heading + (np.pi if wrong else 0.0), 10.0, start_s=0.0)
    evidence = stage(ego, straight(1000.0, y, heading, 15.0, start_s=0.0), ground=RURAL, from_s=0.0)
    assert ("wrong_direction" in striker_offences(evidence, 1, crossing=False)) is wrong
