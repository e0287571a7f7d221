"""Lanes are followed over lane sections and roads, by their links."""

import math
from pathlib import Path

import numpy as np
import pytest

from risk_sac.errors import ConfigError
from risk_sac.world.road_geometry import RoadFile
from risk_sac.world.road_links import LaneEnd, RoadLeg, following, lane_through, leg_line, onward, road_path
from tests.opendrive import ARC, LINE, Lanes, file_xml, road_xml

W = [3.5]
# A lane for turning left grows beside the middle, so that lane -1 goes on as lane -2; lane -2 ends there.
GROWN = (
    Lanes(0.0, {1: W, -1: W, -2: W}, {1: (None, 1), -1: (None, -2), -2: (None, None)}),
    Lanes(50.0, {1: W, -1: [0.0, 0.0, 0.0105, -0.00035 * 0.2], -2: W}, {1: (1, None), -2: (-1, None)}),
)


@pytest.fixture
def roads(tmp_path: Path) -> RoadFile:
    """Road 1, whose lanes change ids, then 2 forwards and 3 backwards."""
    on = '<successor elementType="road" elementId="2" contactPoint="start"/>'
    text = file_xml(
        road_xml("1", [(LINE, 100.0, ())], GROWN, links=on),
        road_xml(
            "2",
            [(ARC, 100.0, (0.01,))],
            [Lanes(0.0, {1: W, -1: W}, {1: (1, -1), -1: (-2, 1)})],
            begin=(100 + 0j, 0.0),
            links='<predecessor elementType="road" elementId="1" contactPoint="end"/>'
            '<successor elementType="road" elementId="3" contactPoint="end"/>',
        ),
        road_xml(
            "3",
            [(LINE, 50.0, ())],
            [Lanes(0.0, {1: W, -1: W}, {1: (None, -1), -1: (None, 1)})],
            links='<successor elementType="road" elementId="2" contactPoint="end"/>',
        ),
    ).replace("<link></link><planView>", "<link/><planView>")
    file = tmp_path / "roads.xodr"
    file.write_text(text)
    return RoadFile.read(file)


def test_a_lane_is_followed_by_its_links_over_lane_sections(roads: RoadFile) -> None:
    road = roads.road("1")
    assert lane_through(road, -1, 10.0, 90.0) == -2
    assert lane_through(road, -2, 90.0, 10.0) == -1
    assert lane_through(road, -2, 10.0, 90.0) == -2  # without a link the id counts
    assert lane_through(road, 1, 90.0, 10.0) == 1
    assert lane_through(road, -3, 10.0, 90.0) is None


def test_the_next_road_tells_which_way_it_is_driven(roads: RoadFile) -> None:
    assert following(roads, roads.road("2"), -1, forward=True) == [LaneEnd("3", 1, False)]
    assert following(roads, roads.road("2"), 1, forward=False) == [LaneEnd("1", 1, False)]
    assert following(roads, roads.road("3"), -1, forward=False) == []


def test_a_way_is_as_long_as_asked_along_the_lane_or_the_reference_lines(roads: RoadFile) -> None:
    begin = LaneEnd("2", -1, True)
    by_lane, missing_m = onward(roads, begin, 0.0, 130.0)
    # The lane is 1.75 m outside an arc of 100 m radius.
    assert by_lane[-1] == RoadLeg("3", False, 50.0, pytest.approx(50.0 - (130.0 - 101.75), abs=0.01), 1, 1)
    assert missing_m == 0.0
    by_road, _ = onward(roads, begin, 0.0, 130.0, by_lane=False)
    assert by_road[-1].to_m == pytest.approx(20.0)
    assert onward(roads, begin, 0.0, 500.0, by_lane=False)[1] == pytest.approx(350.0)


def test_the_shortest_way_changes_lanes_evenly(roads: RoadFile) -> None:
    legs = road_path(roads, LaneEnd("2", -1, True), 20.0, LaneEnd("3", 1, False), 10.0)
    assert [(leg.road, leg.forward, leg.lane, leg.out) for leg in legs] == [("2", True, -1, -1), ("3", False, 1, 1)]
    with pytest.raises(ConfigError) as error:
        road_path(roads, LaneEnd("3", 1, False), 40.0, LaneEnd("1", -1, True), 10.0)
    assert error.value.field == "waypoints"


@pytest.mark.parametrize(("lane", "out", "forward"), [(-1, 1, True), (1, -1, False)])
def test_a_change_of_lanes_begins_and_ends_in_the_middles(
    roads: RoadFile, lane: int, out: int, *, forward: bool
) -> None:
    road = roads.road("3")
    from_m, to_m = (0.0, 50.0) if forward else (50.0, 0.0)
    line = leg_line(road, RoadLeg("3", forward, from_m, to_m, lane, out))
    assert line[0, 1] == pytest.approx(1.75 * lane)
    assert line[-1, 1] == pytest.approx(1.75 * out)
    steps = np.diff(line[:, :2], axis=0)
    along = np.arctan2(steps[:, 1], steps[:, 0])
    middles = (line[1:, 2] + line[:-1, 2]) / 2
    assert max(abs(math.remainder(turn, math.tau)) for turn in along - middles) < 0.01
