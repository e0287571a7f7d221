"""The rules on hand-made frames, through the oracle that finds the contact."""

import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.records import ARTEFACT_RULES
from risk_sac.scenario.bodies import CODES
from risk_sac.verdicts.evidence import PER_ACTOR, Evidence, Ground, recorded_contact
from risk_sac.verdicts.validity import validity_verdicts
from risk_sac.world.types import Frame, Kind
from tests.unit.sim.contacts import (
    CAR,
    CROSSING,
    CUT_IN,
    EGO_DRIFTS,
    FROM_BEHIND,
    HEAD_ON,
    INTO_CROSSING,
    INTO_LEADER,
    INTO_WALKER,
    LENGTH_M,
    SIDESWIPE,
    WALKER_INTO_FLANK,
    WIDTH_M,
    contact_of,
    ego,
    frames,
)
from tests.unit.verdicts.staged import CLEAN, LANE_M, mirrored, sideways, stage, straight


def broken(pair: tuple[Frame, Frame], visible_for_s: float = 3.0, ever_visible: bool = True) -> set[str]:
    """The rules that the first contact between two frames fails."""
    contact = contact_of(*pair)
    names = (*PER_ACTOR, "link")
    series = {name: np.array([getattr(frame, name) for frame in pair]) for name in names}
    series |= {name: getattr(pair[0], name) for name in ("ids", "kind", "body", "role", "length_m", "width_m")}
    series |= {"time_s": np.array([frame.time_s for frame in pair]), "visible": np.ones((2, len(pair[0].ids)))}
    evidence = Evidence.from_series(series, Ground(), 0.0)
    facts = replace(CLEAN, visible_for_s=visible_for_s, ever_visible=ever_visible)
    found = validity_verdicts(evidence, contact.other, contact, facts)
    assert not set(found) & ARTEFACT_RULES
    return {rule for rule, passed in found.items() if not passed}


@pytest.mark.parametrize(
    ("actors", "rules"),
    [
        pytest.param(INTO_LEADER, set(), id="the ego runs into its leader"),
        pytest.param(HEAD_ON, set(), id="head-on"),
        pytest.param(CUT_IN, set(), id="a cut-in onto the front corner"),
        pytest.param(INTO_CROSSING, set(), id="the ego hits crossing traffic"),
        pytest.param(CROSSING, set(), id="crossing traffic, long visible, hits the flank"),
        pytest.param(INTO_WALKER, set(), id="the ego runs over a pedestrian"),
        pytest.param(FROM_BEHIND, {"not_from_behind"}, id="struck from behind"),
        pytest.param(SIDESWIPE, {"no_sideswipe"}, id="sideswiped on the flank"),
        pytest.param(EGO_DRIFTS, set(), id="the ego itself drifts into its neighbour"),
        pytest.param(WALKER_INTO_FLANK, {"no_sideswipe"}, id="a pedestrian walks into the flank"),
    ],
)
def test_geometry_alone_decides_the_degenerate_contacts(actors, rules):
    assert broken(frames(*actors)) == rules


BEHIND_MPS, EGO_MPS = 20.0, 12.0


def from_behind(side: int, gap_m: float, over_m: float = LANE_M, comes_m: float = 0.0, at_s: float = 2.0) -> Evidence:
    """The ego moves `over_m` to `side`, the car behind `comes_m` towards it."""
    since_s = at_s + 1.5
    ego_motion = sideways(straight(0.0, 0.0, 0.0, EGO_MPS), at_s, side * 2.0, over_m)
    rear_m = EGO_MPS * since_s - LENGTH_M - gap_m
    behind = straight(rear_m - BEHIND_MPS * since_s, side * (over_m + comes_m), 0.0, BEHIND_MPS)
    return stage(ego_motion, sideways(behind, at_s, -side * 2.0, comes_m))


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("evidence", "valid"),
    [
        pytest.param(lambda side: from_behind(side, 10.0), True, id="the ego cuts in"),
        pytest.param(lambda side: from_behind(side, 23.0), False, id="the ego leaves room"),
        pytest.param(lambda side: from_behind(side, 12.0, over_m=0.0, comes_m=LANE_M), False, id="the other comes"),
        pytest.param(lambda side: from_behind(side, 12.0, over_m=0.0), False, id="neither moves"),
    ],
)
def test_a_contact_from_behind_counts_if_the_ego_has_just_left_the_other_no_room(side, evidence, valid):
    e = evidence(side)
    contact = recorded_contact(e, 1)
    assert contact.ego_zone == "rear"
    assert validity_verdicts(e, 1, contact, CLEAN)["not_from_behind"] is valid
    assert validity_verdicts(mirrored(e), 1, recorded_contact(mirrored(e), 1), CLEAN)["not_from_behind"] is valid


@pytest.mark.parametrize("side", [1, -1])
def test_a_cut_in_of_more_than_three_seconds_ago_excuses_a_striker_from_behind_no_more(side):
    # At 12.2 m/s it needs 6 s for a gap of 1.2 m, which is less than R157's.
    ego_motion = sideways(straight(0.0, 0.0, 0.0, EGO_MPS), 0.0, side * 2.0, LANE_M)
    behind = straight(-LENGTH_M - 1.5, side * LANE_M, 0.0, EGO_MPS + 0.2)
    e = stage(ego_motion, behind)
    assert not validity_verdicts(e, 1, recorded_contact(e, 1), CLEAN)["not_from_behind"]


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize(("behind_front_m", "rules"), [(1.4, set()), (1.6, {"no_sideswipe"})])
def test_a_flank_contact_is_a_sideswipe_from_one_and_a_half_metres_behind_the_front_bumper(
    mirror, behind_front_m, rules
):
    # A pointed contact: the neighbour stands 12 degrees across and its front corner comes first.
    yaw = -0.2 * mirror
    corner_x = LENGTH_M / 2 * math.cos(yaw) - WIDTH_M / 2 * abs(math.sin(yaw))
    corner_y = LENGTH_M / 2 * abs(math.sin(yaw)) + WIDTH_M / 2 * math.cos(yaw)
    x = LENGTH_M / 2 - behind_front_m - corner_x
    actors = (ego(10.0), (x, mirror * (WIDTH_M / 2 + corner_y), yaw, 10.0, -2.0 * mirror, CAR))
    contact = contact_of(*frames(*actors))
    assert contact.x_m == pytest.approx(LENGTH_M / 2 - behind_front_m, abs=0.01)
    assert contact.ego_zone == ("left" if mirror == 1 else "right")
    assert broken(frames(*actors)) == rules


@pytest.mark.parametrize(("angle_deg", "rules"), [(25.0, {"no_sideswipe"}), (35.0, set())])
def test_a_crossing_conflict_takes_headings_30_degrees_apart(angle_deg, rules):
    yaw = math.radians(angle_deg)
    reach = LENGTH_M / 2 * math.sin(yaw) + WIDTH_M / 2 * math.cos(yaw)
    corner_x = LENGTH_M / 2 * math.cos(yaw) - WIDTH_M / 2 * math.sin(yaw)
    x = -1.0 - corner_x
    actors = (ego(8.0), (x, -WIDTH_M / 2 - reach, yaw, 10 * math.cos(yaw), 10 * math.sin(yaw), CAR))
    assert broken(frames(*actors)) == rules


@pytest.mark.parametrize(("speed_mps", "rules"), [(0.0, {"ego_moving"}), (0.49, {"ego_moving"}), (0.51, set())])
def test_a_standing_ego_has_no_part_in_its_collision(speed_mps, rules):
    assert broken(frames(ego(speed_mps), (LENGTH_M, 0.0, math.pi, -10.0, 0.0, CAR))) == rules


@pytest.mark.parametrize("side", [1, -1])
def test_a_cyclist_that_crosses_into_the_flank_counts_as_crossing_traffic_does(side):
    pair = frames(ego(10.0), (-1.0, -side * (WIDTH_M / 2 + 0.25), side * math.pi / 2, 0.0, side * 5.0, Kind.PEDESTRIAN))
    rider = tuple(frame._replace(body=np.array([CODES["car"], CODES["bicycle"]], dtype=np.int8)) for frame in pair)
    assert broken(pair) == {"no_sideswipe"}
    assert broken(rider) == set()
    assert broken(rider, visible_for_s=0.5) == {"no_sideswipe"}
