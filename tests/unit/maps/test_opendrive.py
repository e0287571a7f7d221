import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from risk_sac.maps.convert import Converted, present_net
from risk_sac.maps.finder import Map, survey
from risk_sac.world.net import Net

LINE = '<geometry s="0" x="0" y="0" hdg="0" length="900"><line/></geometry>'


def lane(id_: int, inside: str = "", kind: str = "driving", width: str = 'a="3.5" b="0" c="0" d="0"') -> str:
    return f'<lane id="{id_}" type="{kind}"><width sOffset="0" {width}/>{inside}</lane>'


def section(*lanes: str, s: float = 0.0, left: str = "") -> str:
    center = '<center><lane id="0" type="none"/></center>'
    return f'<laneSection s="{s}"><left>{left}</left>{center}<right>{"".join(lanes)}</right></laneSection>'


def road(
    *sections: str,
    types: str = "",
    plan: str = LINE,
    length: float = 900.0,
    more: str = "",
    id_: int = 1,
    junction: int = -1,
) -> str:
    lanes = f"<lanes>{''.join(sections)}</lanes>"
    head = f'<road id="{id_}" length="{length}" junction="{junction}">'
    return f"{head}{types}<planView>{plan}</planView>{lanes}{more}</road>"


def crosswalk(*places: float) -> str:
    objects = (f'<object id="{i}" type="crosswalk" s="{s}" t="0"/>' for i, s in enumerate(places))
    return f"<objects>{''.join(objects)}</objects>"


def kind(speed: str, s: float = 0.0, of: str = "rural") -> str:
    return f'<type s="{s}" type="{of}">{speed}</type>'


def read(folder: Path, content: str) -> tuple[Net, Converted]:
    (folder / "map.xodr").write_text(f'<OpenDRIVE><header revMajor="1" revMinor="7"/>{content}</OpenDRIVE>')
    made = present_net(folder / "map.xodr", folder)
    return Map(made.file).net, made


def limits(net: Net) -> list[tuple[float, list[float]]]:
    """Returns each edge's begin and its lanes' limits from left to right."""
    found = [
        (edge.lanes[0].line[0][0], [round(lane.limit_mps, 2) for lane in edge.lanes[::-1]])
        for edge in net.edges.values()
    ]
    return sorted((round(x, -1), mps) for x, mps in found)


@pytest.mark.parametrize(
    ("speed", "mps"),
    [
        ('<speed max="130" unit="km/h"/>', 36.11),
        ('<speed max="25" unit="mph"/>', 11.18),
        ('<speed max="8.33" unit="m/s"/>', 8.33),
        ('<speed max="20"/>', 20.0),
        ('<speed max="no limit"/>', 39.44),
        ('<speed max="undefined"/>', 13.89),
        ("", 13.89),
    ],
)
def test_the_limit_of_a_road_is_that_of_its_lanes(tmp_path, speed, mps):
    net, made = read(tmp_path, road(section(lane(-1), lane(-2)), types=kind(speed)))
    assert limits(net) == [(0.0, [mps, mps])]
    assert any("without a speed limit" in warning for warning in made.warnings) == (mps == 13.89)


def test_a_motorway_that_states_no_limit_has_none(tmp_path):
    net, _ = read(tmp_path, road(section(lane(-1)), types=kind("", of="motorway")))
    assert limits(net) == [(0.0, [39.44])]


def test_limits_begin_where_they_are_given_and_that_of_a_lane_is_ahead(tmp_path):
    types = kind('<speed max="30"/>') + kind('<speed max="20"/>', 400.0) + kind("", 800.0)
    own = '<speed sOffset="100" max="36" unit="km/h"/><speed sOffset="200" max="undefined"/>'
    content = road(
        section(lane(-1)),
        section(lane(-1), lane(-2, own + '<link><predecessor id="-1"/></link>'), s=300.0),
        types=types,
    )
    net, _ = read(tmp_path, content)
    expected = [
        (0.0, [30.0]),
        (300.0, [30.0, 30.0]),
        (400.0, [20.0, 10.0]),
        (500.0, [20.0, 20.0]),
        (800.0, [13.89, 13.89]),
    ]
    assert limits(net) == expected
    links = [link for links in net.onward.values() for link in links if len(net.edges[link.source.edge].lanes) == 2]
    steps = {(link.source.index, link.target.index) for link in links}
    assert steps == {(0, 0), (1, 1)}


@pytest.mark.parametrize("curvature", [0.01, -0.01])
@pytest.mark.parametrize("by", [0.0, 1e-17, 5e-7])
def test_a_spiral_of_nearly_constant_curvature_is_the_arc(tmp_path, curvature, by):
    turn = curvature * 150.0
    x, y = 300.0 + math.sin(turn) / curvature, (1.0 - math.cos(turn)) / curvature
    bend = f'<spiral curvStart="{curvature}" curvEnd="{curvature + by:.20f}"/>'
    line = _drawn(tmp_path, bend, (x, y, turn))
    radius = 1 / abs(curvature) + math.copysign(1.75, curvature)
    off = [abs(math.dist(point, (300.0, 1 / curvature)) - radius) for point in line if 300.0 < point[0] < x - 1.0]
    assert len(off) > 50
    assert max(off) < 0.05


def test_a_real_spiral_stays_one(tmp_path):
    heading = [0.01 * s**2 / 300.0 for s in np.arange(0.05, 150.0, 0.1)]
    x, y = 300.0 + 0.1 * np.cos(heading).sum(), 0.1 * np.sin(heading).sum()
    line = _drawn(tmp_path, '<spiral curvStart="0" curvEnd="0.01"/>', (x, y, 0.75))
    end = (x + 1.75 * math.sin(0.75), y - 1.75 * math.cos(0.75))
    assert min(math.dist(point, end) for point in line) < 0.2


def _drawn(folder: Path, bend: str, end: tuple[float, float, float]) -> Sequence[tuple[float, float]]:
    """Returns the lane of a road with a bend between two straights."""
    x, y, heading = end
    plan = (
        '<geometry s="0" x="0" y="0" hdg="0" length="300"><line/></geometry>'
        f'<geometry s="300" x="300" y="0" hdg="0" length="150">{bend}</geometry>'
        f'<geometry s="450" x="{x}" y="{y}" hdg="{heading}" length="300"><line/></geometry>'
    )
    net, _ = read(folder, road(section(lane(-1)), plan=plan, length=750.0))
    (edge,) = net.edges.values()
    _, left_y = edge.lanes[0].line[0]  # netconvert moves a map
    return [(x, y - left_y - 1.75) for x, y in edge.lanes[0].line]


SIDEWALK = {"kind": "sidewalk", "width": 'a="2" b="0" c="0" d="0"'}


@pytest.mark.parametrize("has_sidewalks", [True, False])
def test_a_crosswalk_amid_a_road_is_a_crossing(tmp_path, has_sidewalks):
    left, right = lane(1), lane(-1)
    if has_sidewalks:
        left, right = lane(2, **SIDEWALK) + left, right + lane(-2, **SIDEWALK)
    types = kind('<speed max="10"/>')
    net, made = read(tmp_path, road(section(right, left=left), types=types, more=crosswalk(400.0, 600.0)))
    assert [(crossing.edges, round(crossing.line[0][0])) for crossing in net.crossings] == [
        (("1.0.00", "-1.0.00"), 400),
        (("1.400.00", "-1.400.00"), 600),
    ]
    assert survey(net).counts["crossing"]
    assert not any("crosswalk" in warning for warning in made.warnings)


def test_a_crosswalk_within_a_junction_is_that_of_the_road_beside(tmp_path):
    both = section(lane(-1, LINKED.format(-1)), left=lane(1, LINKED.format(1)))
    ends = '<link><predecessor elementType="road" elementId="1" contactPoint="end"/>{}</link>'
    into = ends.format('<successor elementType="road" elementId="2" contactPoint="start"/>')
    meets = '<link><{} elementType="junction" elementId="9"/></link>'
    content = (
        road(both, types=meets.format("successor"), plan=_straight(0, 400), length=400.0)
        + road(both, types=into, plan=_straight(400, 20), length=20.0, id_=3, junction=9, more=crosswalk(18.0))
        + road(both, types=meets.format("predecessor"), plan=_straight(420, 400), length=400.0, id_=2)
        + '<junction id="9"><connection id="0" incomingRoad="1" connectingRoad="3" contactPoint="start">'
        + '<laneLink from="-1" to="-1"/></connection></junction>'
    )
    net, made = read(tmp_path, content)
    assert [(crossing.junction, set(crossing.edges)) for crossing in net.crossings] == [("9", {"-2.0.00", "2.0.00"})]
    assert not any("crosswalk" in warning for warning in made.warnings)


LINKED = '<link><predecessor id="{0}"/><successor id="{0}"/></link>'


def _straight(x: float, length: float) -> str:
    return f'<geometry s="0" x="{x}" y="0" hdg="0" length="{length}"><line/></geometry>'


def test_a_lane_keeps_its_width_where_a_limit_begins_within_its_section(tmp_path):
    types = kind('<speed max="30"/>') + kind('<speed max="20"/>', 450.0)
    net, _ = read(tmp_path, road(section(lane(-1, width='a="3" b="0.002" c="0" d="0"')), types=types))
    assert [edge.lanes[0].width_m for edge in net.edges.values()] == pytest.approx([3.0, 3.9], abs=0.01)
