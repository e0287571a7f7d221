"""Lanes lie where Fresnel integrals and adaptive quadrature put them."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from risk_sac.errors import ConfigError, MapError
from risk_sac.world.plane_curves import Begin, Clothoid
from risk_sac.world.road_geometry import RoadFile
from tests.opendrive import ARC, LINE, PARAM, POLY, SPIRAL, Lanes, file_xml, lane_at, road_xml

TWO = {2: [3.0], 1: [3.5], -1: [3.5], -2: [3.0]}
# Its length is that of the cubic, to 1e-9 m: u = 30 p, v = 6 p² - 2 p³.
CUBIC = (0.0, 30.0, 0.0, 0.0, 0.0, 0.0, 6.0, -2.0)
CUBIC_M = 30.317601947


SHAPES = (
    (LINE, 40.0, ()),
    (SPIRAL, 50.0, (0.0, 0.02)),
    (ARC, 30.0, (0.02,)),
    (SPIRAL, 60.0, (0.02, -0.03)),
    (ARC, 25.0, (-0.03,)),
    (POLY, 20.0, (0.0, 0.0, 0.004, -0.0001)),
    (PARAM, CUBIC_M, CUBIC),
    (LINE, 20.0, ()),
)
LENGTH_M = sum(shape[1] for shape in SHAPES)
WIDENED = Lanes(90.0, {**TWO, -2: [3.0, 0.05], 1: [3.5, 0.0, 0.001]})
NARROW = Lanes(160.0, {1: [3.2], -1: [3.0, 0.0, 0.0005, -0.000004]})


def bent(tmp_path: Path, rule: str = "RHT") -> tuple[RoadFile, ET.Element]:
    """Road of all shapes, with three lane sections and a lane offset."""
    offsets = [(0.0, 0.5), (60.0, 0.5, 0.0, 0.0012, -0.000016), (110.0, 1.5)]
    sections = (Lanes(0.0, TWO), WIDENED, NARROW)
    begin = complex(100.0, -50.0), 0.7
    text = file_xml(road_xml("7", SHAPES, sections, begin=begin, rule=rule, offsets=offsets))
    file = tmp_path / "bent.xodr"
    file.write_text(text)
    return RoadFile.read(file), ET.fromstring(text)


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
def test_lanes_lie_and_lead_where_the_independent_evaluation_says(tmp_path: Path, rule: str) -> None:
    roads, root = bent(tmp_path, rule)
    road = roads.road("7")
    assert road.length_m == pytest.approx(LENGTH_M)
    for s_m in np.arange(0.5, LENGTH_M - 0.5, 1.7).tolist():
        for lane in road.section(s_m).lanes:
            x_m, y_m, along = road.point(s_m, road.middle(lane, s_m))
            heading = along + (math.pi if road.backwards(lane) else 0.0)
            there = lane_at(root, "7", lane, s_m)
            assert math.dist((x_m, y_m), there[:2]) < 1e-3, (s_m, lane)
            assert abs(math.remainder(heading - there[2], math.tau)) < math.radians(0.02), (s_m, lane)


def test_a_point_is_projected_to_where_it_was_taken_from(tmp_path: Path) -> None:
    road = bent(tmp_path)[0].road("7")
    for s_m in np.arange(1.0, LENGTH_M - 1.0, 3.3).tolist():
        for lane in road.section(s_m).lanes:
            middle = road.middle(lane, s_m)
            x_m, y_m, _ = road.point(s_m, middle)
            assert road.project(x_m, y_m) == pytest.approx((s_m, middle.t_m), abs=1e-5)
            assert road.lane_at(s_m, middle.t_m) == lane


def test_a_clothoid_from_a_line_is_a_fresnel_integral() -> None:
    curve = Clothoid(Begin(0.0, 0.0, 0.0), 0.0, math.pi, 1.0)
    (x, y, heading, curvature) = curve.at(np.array([1.0]))[0].tolist()
    # C(1) and S(1), Abramowitz & Stegun, Table 7.7.
    assert (x, y) == (pytest.approx(0.7798934, abs=1e-7), pytest.approx(0.4382591, abs=1e-7))
    assert (heading, curvature) == (pytest.approx(math.pi / 2), pytest.approx(math.pi))


def test_a_mirrored_road_is_the_mirror_image(tmp_path: Path) -> None:
    left, right = (
        file_xml(road_xml("1", [(SPIRAL, 60.0, (0.0, k)), (ARC, 40.0, (k,))], [Lanes(0.0, {1: [3.0], -1: [3.0]})]))
        for k in (0.02, -0.02)
    )
    places = []
    for text, lane in ((left, -1), (right, 1)):
        file = tmp_path / "mirrored.xodr"
        file.write_text(text)
        road = RoadFile.read(file).road("1")
        places.append(road.point(83.0, road.middle(lane, 83.0)))
    (x0, y0, h0), (x1, y1, h1) = places
    assert (x0, y0, h0) == (pytest.approx(x1), pytest.approx(-y1), pytest.approx(-h1))


def test_a_lane_that_is_not_there_is_refused_with_those_that_are(tmp_path: Path) -> None:
    roads = bent(tmp_path)[0]
    with pytest.raises(ConfigError) as error:
        roads.road("7").middle(-2, 200.0)
    assert (error.value.field, error.value.expected) == ("lane", "one of -1, 1")
    with pytest.raises(ConfigError) as error:
        roads.road("8")
    assert error.value.field == "road"


@pytest.mark.parametrize(
    "text",
    [
        "no XML",
        "<net/>",
        '<!DOCTYPE OpenDRIVE [<!ENTITY a "b">]><OpenDRIVE/>',
        '<OpenDRIVE><road id="1" length="1"/></OpenDRIVE>',
        file_xml(road_xml("1", [(LINE, 10.0, ())], [Lanes(0.0, {-2: [3.0]})])),
        file_xml(road_xml("1", [(LINE, math.nan, ())], [Lanes(0.0, {-1: [3.0]})])),
        file_xml(road_xml("1", [(LINE, 1e9, ())], [Lanes(0.0, {-1: [3.0]})])),
        file_xml(road_xml("1", [(SPIRAL, 100.0, (0.0, 1e6))], [Lanes(0.0, {-1: [3.0]})])),
    ],
)
def test_a_broken_file_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "broken.xodr"
    file.write_text(text)
    with pytest.raises(MapError) as error:
        RoadFile.read(file)
    assert error.value.field == "road"
