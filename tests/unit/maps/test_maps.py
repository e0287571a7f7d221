import math
import re
from collections.abc import Mapping
from contextlib import closing, nullcontext
from pathlib import Path

import libsumo
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import LineString, Point, box
from shapely.affinity import affine_transform

import sumo_nets
from risk_sac.config import EgoConfig
from risk_sac.errors import DamagedError, MapError
from risk_sac.maps.convert import present_net
from risk_sac.maps.find_junction import turn
from risk_sac.maps.finder import Map, place_at, survey
from risk_sac.maps.found import NET, NoFit, Pattern, lacking
from risk_sac.maps.ways import way_back, way_on
from risk_sac.scenario import library
from risk_sac.scenario.families import FAMILIES, Family, family_named, family_of
from risk_sac.scenario.ground import kerb_of, too_near, truck_reaches, waits_in_the_way
from risk_sac.scenario.layout import VehicleStart
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.net import Crossing, Edge, Link, Net, NetLane
from risk_sac.world.read_net import read_net
from tests.maps import osm_town

LANE = '<lane id="{id}_0" index="0" speed="13.89" length="{m}" shape="{line}"/>'


ROAD = '<edge id="{id}" from="{a}" to="{b}">' + LANE + "</edge>"


def road(id_: str, a: str, b: str, metres: float, line: str) -> str:
    return ROAD.format(id=id_, a=a, b=b, m=metres, line=line)


NETS = Path(sumo_nets.__path__[0])


def found_at(name: str, pattern: Pattern, place: str) -> Family:
    """A place on a shipped net, as a family."""
    file = NETS / name / f"{name}.net.xml"
    return family_of(place_at(read_net(file), pattern, place).scenario, {NET: str(file)})


def scenes(family: Family, count: int, seed: int) -> list[Mapping[str, float]]:
    points = np.random.default_rng(seed).random((count, family.space.dimension))
    return [family.space.from_unit(point).values for point in points]


def where(start: VehicleStart) -> tuple[object, ...]:
    return start.route[0], start.lane, pytest.approx(start.position_m), start.speed_mps, start.body


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    folder = tmp_path_factory.mktemp("town")
    (folder / "town.osm").write_text(osm_town())
    return Map(present_net(folder / "town.osm", folder).file)


def test_the_finder_finds_the_junction_that_is_shipped():
    found, shipped = found_at("dense", "junction", "from_south"), FAMILIES["dense"]
    assert found.adversaries == shipped.adversaries
    bounds = [[(p.name, p.low, p.high, p.odd) for p in family.space.parameters] for family in (found, shipped)]
    assert bounds[0] == bounds[1]
    assert found.odd == shipped.odd
    for scene in scenes(shipped, 50, 1):
        mine, ours = found.layout(scene), shipped.layout(scene)
        assert where(mine.ego) == where(ours.ego)
        assert sorted(map(where, mine.vehicles), key=str) == sorted(map(where, ours.vehicles), key=str)
        assert (mine.signal, mine.signal_offset_s) == (ours.signal, ours.signal_offset_s)
        (walker,), (other,) = mine.pedestrians, ours.pedestrians
        # The finder leaves room for cars that turn round the corner.
        assert (walker.x_m, walker.y_m) == pytest.approx((other.x_m, other.y_m), abs=1.0)
        assert walker.heading_rad == pytest.approx(other.heading_rad)


@pytest.mark.parametrize(("edge", "crossing"), [("e1", 0.0), ("e2", 1.0)])
def test_the_finder_finds_the_crossings_that_are_shipped(edge, crossing):
    found, shipped = found_at("mixed", "crossing", edge), FAMILIES["mixed"]
    assert found.adversaries == shipped.adversaries
    near = {"ego_distance_m": 30.0, "occluder_distance_m": 5.0, "ego_speed_mps": 6.0, "occluder_speed_mps": 0.0}
    for scene in scenes(shipped, 20, 1):
        scene = {**scene, **near, "crossing": crossing}
        mine, ours = found.layout(scene), shipped.layout(scene)
        starts, others = ({start.id: where(start) for start in layout.vehicles} for layout in (mine, ours))
        assert (where(mine.ego), starts["occluder"]) == (where(ours.ego), others["occluder"])
        assert {start[0] for name, start in starts.items() if name.startswith("oncoming")} == {
            start[0] for name, start in others.items() if name.startswith("oncoming")
        }
        (walker,), (other,) = mine.pedestrians, ours.pedestrians
        assert (walker.x_m, walker.y_m) == pytest.approx((other.x_m, other.y_m))


def test_ground_that_is_found_is_the_ground_that_was_drawn_by_hand():
    mine, ours = found_at("dense", "junction", "from_south"), FAMILIES["dense"]
    middle = ours.space.from_unit(np.full(ours.space.dimension, 0.5)).values
    layouts = mine.layout(middle), ours.layout(middle)
    points = np.random.default_rng(2).uniform((-7.9, -30.0), (7.9, -4.0), (300, 2))  # the ego's road and its crossing
    for x, y in points:
        for name in ("crossings", "junctions")[: 1 if y < -15.5 else 2]:  # netconvert's junction has its crossings
            here = [any(area.grown(by).contains(x, y) for area in getattr(layouts[1], name)) for by in (-0.1, 0.1)]
            if here[0] == here[1]:  # not on the edge, of which 5 cm were taken
                assert any(area.contains(x, y) for area in getattr(layouts[0], name)) == here[0], (name, x, y)


def test_a_town_has_places_of_all_patterns_and_each_is_kept_as_a_small_net(town, tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    found = survey(town.net)
    assert set(found.counts) == {"car_following", "crossing", "junction"}
    assert all(misfit.why for misfit in found.misfits)
    for fit in (found.fits[0], found.fits[-1]):
        name = town.keep(fit)
        minus = "minus_" * fit.spot.id.startswith("-")
        assert name.startswith(f"{fit.spot.pattern}_{minus}{fit.spot.id.lstrip('-').replace('#', '_')}_")
        assert town.keep(fit) == name
        assert library.kept(name)[0] == fit.scenario
        family = family_named(name)
        layout = family.layout(family.space.from_unit(np.full(family.space.dimension, 0.5)).values)
        assert layout.wary
        libsumo.start(["sumo", "-n", layout.net, "--no-step-log", "--no-warnings"])
        try:
            for start in (layout.ego, *layout.vehicles):
                assert start.position_m <= libsumo.lane.getLength(f"{start.route[0]}_{start.lane}")
                assert libsumo.simulation.findRoute(start.route[0], start.route[-1]).edges
        finally:
            libsumo.close()


def test_a_kept_place_that_was_changed_is_refused(town, tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    name = town.keep(survey(town.net, ("junction",)).fits[0])
    net = tmp_path / name / NET
    net.write_bytes(net.read_bytes()[:-20])
    with pytest.raises(DamagedError, match="keep it once more"):
        library.kept(name)
    assert town.keep(survey(town.net, ("junction",)).fits[0]) == name
    assert library.kept(name)


def test_on_a_road_of_one_lane_who_came_the_other_way_hides_a_pedestrian_from_the_left(town, tmp_path, monkeypatch):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    fits = [
        fit for fit in survey(town.net, ("crossing",)).fits if fit.scenario.actors["pedestrian"].start.side == "left"
    ]
    assert len(fits) > 10
    family = family_named(town.keep(fits[0]))
    scene = family.space.from_unit(np.full(family.space.dimension, 0.5)).values
    hidden = {"occluder_distance_m": 0.5, "occluder_speed_mps": 0.0}
    hidden |= {"pedestrian_setback_m": 0.3, "pedestrian_speed_mps": 0.0}
    with closing(SumoSimulation(EgoConfig())) as sim:
        frame = sim.reset(family.layout({**scene, **hidden}), 1)
    ego, occluder, pedestrian = (frame.ids.index(id_) for id_ in ("ego", "occluder", "pedestrian"))
    at = [Point(x, y) for x, y in zip(frame.x_m, frame.y_m, strict=True)]
    cos, sin = np.cos(frame.heading_rad[occluder]), np.sin(frame.heading_rad[occluder])
    body = affine_transform(box(-4.0, -1.2, 4.0, 1.2), [cos, -sin, sin, cos, at[occluder].x, at[occluder].y])
    (start,) = family.layout({**scene, **hidden, "pedestrian_offset_m": 0.0}).pedestrians
    walk = np.cos(start.heading_rad), np.sin(start.heading_rad)
    over = [Point(start.x_m + m * walk[0], start.y_m + m * walk[1]) for m in np.arange(0.3, 12.3, 0.5)]
    assert sum(LineString([at[ego], point]).crosses(body) for point in over) >= 4  # 2 m of its way, or more
    ahead, aside = at[pedestrian].x - at[ego].x, at[pedestrian].y - at[ego].y
    assert aside * np.cos(frame.heading_rad[ego]) - ahead * np.sin(frame.heading_rad[ego]) > 3.0  # on its left
    assert np.cos(frame.heading_rad[occluder] - frame.heading_rad[ego]) < -0.9


FORK = (
    "<net>"
    '<edge id="a" from="0" to="1"><lane id="a_0" index="0" speed="10" length="200" shape="0,0 200,0"/></edge>'
    '<edge id="b" from="1" to="2"><lane id="b_0" index="0" speed="10" length="90" shape="210,-2 300,-2"/>'
    '<lane id="b_1" index="1" speed="10" length="90" shape="210,2 300,2"/></edge>'
    '<edge id="c" from="2" to="3"><lane id="c_0" index="0" speed="10" length="900" shape="310,-2 1210,-2"/>'
    '<lane id="c_1" index="1" speed="10" length="900" shape="310,2 1210,2"/></edge>'
    '<connection from="a" to="b" fromLane="0" toLane="0" dir="s"/>'
    '<connection from="a" to="b" fromLane="0" toLane="1" dir="s"/>'
    '{right}<connection from="b" to="c" fromLane="1" toLane="1" dir="s"/></net>'
)
RIGHT = '<connection from="b" to="c" fromLane="0" toLane="0" dir="s"/>'


@pytest.mark.parametrize(("right", "comes_from"), [(RIGHT, []), ("", ["a"])])
def test_nobody_is_placed_before_a_fork_that_would_lead_it_into_another_lane(tmp_path, right, comes_from):
    """Where lanes lead on alike, SUMO's drivers take the right one."""
    file = tmp_path / "map.net.xml"
    file.write_text(FORK.format(right=right))
    net = read_net(file)
    way = way_back(net, net.lane("b_1"), 150.0, ["c"])
    assert [lane.edge for lane in way.lanes] == [*comes_from, "b"]


@pytest.mark.parametrize(("x_m", "stands_clear"), [(0.0, True), (-6.0, False)])
def test_who_waits_askew_in_the_way_of_others_is_told_from_who_stands_clear(x_m, stands_clear):
    """Its front is 1.6 m from the middle of the lane crossed."""

    def lane(id_, *line):
        return NetLane(id_, id_, 0, 10.0, 3.2, 10.0, line, True)

    before, behind = lane("i_0", (x_m, -5.6), (0.0, -1.6)), lane("i_1", (0.0, -1.6), (-3.0, 6.0))
    across, crossed_before = lane("across", (10.0, 0.0), (-10.0, 0.0)), lane("crossed", (9.0, -3.0), (-9.0, -3.0))
    joined = lane("joined", (3.0, -6.0), (-3.0, 6.0))
    net = Net(waits_for={"i_1": (crossed_before, joined, across)})
    link = Link(
        lane("from", (0.0, -20.0), (0.0, -10.0)), lane("to", (-3.0, 6.0), (-3.0, 9.0)), (before, behind), None, 0
    )
    assert waits_in_the_way(net, link) is (None if stands_clear else across)


BEND = (
    "<net>"
    '<edge id=":1_0" function="internal"><lane id=":1_0_0" index="0" speed="10" length="30" shape="{outer}"/>'
    '<lane id=":1_0_1" index="1" speed="10" length="25" shape="{inner}"/></edge>'
    '<edge id="a" from="0" to="1"><lane id="a_0" index="0" speed="10" length="200" shape="{before_0}"/>'
    '<lane id="a_1" index="1" speed="10" length="200" shape="{before_1}"/></edge>'
    '<edge id="b" from="1" to="2"><lane id="b_0" index="0" speed="10" length="900" shape="{behind_0}"/>'
    '<lane id="b_1" index="1" speed="10" length="900" shape="{behind_1}"/></edge>'
    '<junction id="1" type="priority" x="0" y="0" incLanes="a_0 a_1" intLanes=":1_0_0 :1_0_1" shape="0,0 20,0 20,20"/>'
    '<connection from="a" to="b" fromLane="0" toLane="0" via=":1_0_0" dir="l"/>'
    '<connection from="a" to="b" fromLane="1" toLane="1" via=":1_0_1" dir="l"/></net>'
)


@pytest.mark.parametrize(("signal", "comes_from"), [("", ["a"]), (' tl="t" linkIndex="0"', [])])
def test_nobody_is_placed_before_a_signal_that_may_be_red_until_the_end(tmp_path, signal, comes_from):
    file = tmp_path / "map.net.xml"
    to_the_left = '<connection from="a" to="b" fromLane="0" toLane="1" dir="s"'
    file.write_text(FORK.format(right="").replace(to_the_left, to_the_left + signal))
    net = read_net(file)
    way = way_back(net, net.lane("b_1"), 150.0, ["c"])
    assert [lane.edge for lane in way.lanes] == [*comes_from, "b"]


def test_nobody_is_led_where_a_signal_stays_red(tmp_path):
    """A signal with several programmes, of which SUMO runs the last."""
    shipped_net = (NETS / "dense" / "dense.net.xml").read_text()
    stays = '<tlLogic id="centre" type="static" programID="1"><phase duration="1000" state="{}"/></tlLogic><junction'
    turned = tmp_path / "map.net.xml"
    turned.write_text(shipped_net.replace("<junction", stays.format("rrrrgGGgrrrrgGGgGrGr"), 1))
    net = read_net(turned)
    assert place_at(net, "junction", "from_east").scenario
    with pytest.raises(MapError, match=r"'from_south' leads nowhere: .* its signal ever lets anybody take"):
        place_at(net, "junction", "from_south")
    turned.write_text(shipped_net.replace("<junction", stays.format("rrrrrrrrrrrrrGGgrrrr"), 1))
    onward = read_net(turned).onward
    assert "from_west_2" in onward
    assert "from_south_1" not in onward


WIDE, NARROW = "7,6 14,11", "9,4.5 16,9"


def bend(file: Path, middle: str, *, to_the_left: bool) -> Net:
    """Two lanes that turn; the inner way is drawn through `middle`."""
    lines = {"outer": "-2,0 9,3 17,8 20,20", "inner": f"-2,3 {middle} 17,20"}
    lines |= {"before_0": "-202,0 -2,0", "before_1": "-202,3 -2,3"}
    lines |= {"behind_0": "20,20 20,920", "behind_1": "17,20 17,920"}
    if not to_the_left:  # mirrored, and the lanes change places: their indices count from the right
        lines = {name: line.replace(",", ",-") for name, line in lines.items()}
        for one, other in (("outer", "inner"), ("before_0", "before_1"), ("behind_0", "behind_1")):
            lines[one], lines[other] = lines[other], lines[one]
    file.write_text(BEND.format(**lines))
    return read_net(file)


@pytest.mark.parametrize("to_the_left", [True, False])
@pytest.mark.parametrize(("middle", "there_is_room"), [(WIDE, True), (NARROW, False)])
def test_nobody_is_led_over_a_junction_that_two_abreast_have_no_room_on(tmp_path, middle, there_is_room, to_the_left):
    net = bend(tmp_path / "map.net.xml", middle, to_the_left=to_the_left)
    for lane, other in (("a_0", "a_1"), ("a_1", "a_0")):
        (link,) = net.onward[lane]
        assert too_near(net, link) is (None if there_is_room else net.onward[other][0])
        with nullcontext() if there_is_room else pytest.raises(NoFit):
            turn(net, link, 10.0)
        with nullcontext() if there_is_room else pytest.raises(NoFit):
            way_on(net, net.lane(lane), 40.0)
        assert len(way_back(net, link.target, 150.0).lanes) == (2 if there_is_room else 1)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("radius_m", "reaches"), [(12.0, False), (0.5, True)])
def test_a_truck_that_turns_sharply_beside_a_car_swings_its_tail_into_its_way(radius_m, reaches, side):
    """It turns away from a car that drives straight on beside it."""
    quarter = [math.radians(10.0 * i) for i in range(10)]
    arc = [(radius_m * math.sin(a), -side * radius_m * (1.0 - math.cos(a))) for a in quarter]

    def link(id_, *lines):
        source, middle, target = (NetLane(id_, id_, 0, 1.0, 3.2, 10.0, tuple(line), True) for line in lines)
        return Link(source, target, (middle,), None, 0)

    away = (radius_m, -side * (radius_m + 90.0))
    truck = link("right", [(-90.0, 0.0), (0.0, 0.0)], arc, [arc[-1], away])
    straight = [(x, side * 3.2) for x in (-90.0, 0.0, 20.0, 90.0)]
    car = link("left", straight[:2], straight[1:3], straight[2:])
    assert truck_reaches(Net(onward={"right": [truck], "left": [car]}), truck, car) == reaches
    farther = link("left", straight[:2], [straight[1], (20.0, side * 9.0)], [(20.0, side * 9.0), (90.0, side * 9.0)])
    forked = Net(onward={"right": [truck], "left": [farther, car]})
    assert truck_reaches(forked, truck, farther) == reaches


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("radius_m", [1.5, 4.0, 12.0])
def test_who_waits_at_a_kerb_is_clear_of_a_car_that_turns_round_the_corner(radius_m, side):
    """It drives 1.6 m from the kerb and turns behind the crossing."""
    quarter = [math.radians(5.0 * i) for i in range(19)]
    arc = [(side * (-1.6 + radius_m * (1.0 - math.cos(a))), 2.0 + radius_m * math.sin(a)) for a in quarter]
    lines = [(-1.6 * side, -60.0), (-1.6 * side, 2.0)], arc, [arc[-1], (90.0 * side, arc[-1][1])]
    source, middle, target = (
        NetLane(id_, id_, 0, 1.0, 3.2, 10.0, tuple(line), True) for id_, line in zip("abc", lines, strict=True)
    )
    crossing = Crossing("crossing", "j", ("a",), ((0.0, 0.0), (-6.4 * side, 0.0)), 4.0, None)
    net = Net(edges={"a": Edge("a", "i", "j", (source,))}, crossings=[crossing])
    net.onward["a"] = [Link(source, target, (middle,), None, 0)]
    walk = kerb_of(net, crossing, side * math.pi / 2)
    assert (walk.along_x, walk.along_y) == (-side, 0.0)
    waiting = [
        (walk.x_m + 0.3 * side, y) for y in np.linspace(-1.9, 1.9, 39)
    ]  # as near to the kerb as a scene may have it
    way = LineString([*lines[0], *arc, *lines[2]])
    for front_m in np.arange(58.0, 75.0, 0.1):
        chord = LineString([way.interpolate(front_m), way.interpolate(front_m - 4.6)])
        car = chord.buffer(1.85 / 2, cap_style="flat")
        assert min(car.distance(Point(point)) for point in waiting) > 0.25 + 0.1  # half a person, and a little
    assert (walk.x_m == pytest.approx(-0.05 * side)) == (radius_m == 12.0)  # none is sent back without need


LIKE = {"car_following": "low", "crossing": "mixed", "junction": "dense"}


@pytest.mark.parametrize("pattern", LIKE)
def test_every_place_is_a_scenario_whose_prior_fits(town, tmp_path, monkeypatch, pattern):
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    for fit in survey(town.net, (pattern,)).fits[::20]:
        family = family_named(town.keep(fit))
        assert family.like.family == LIKE[pattern]
        assert family.stand_ins == family.adversaries
        assert set(family.like.actors) == set(family.adversaries)
        for scene in scenes(family, 10, 2):
            layout = family.layout(scene)
            assert all(start.position_m >= 0.0 for start in (layout.ego, *layout.vehicles))


def test_a_pattern_without_any_candidate_says_why():
    found = survey(read_net(NETS / "low" / "low.net.xml"))
    assert set(found.nowhere) == {"crossing", "junction"}
    assert "has no road to a junction" in found.nowhere["junction"]


def test_a_way_that_is_barely_too_short_contradicts_itself_nowhere(tmp_path):
    file = tmp_path / "map.net.xml"
    for seconds, says in ((16.96, "after driving 16.9 s; wanted 17 s"), (16.999, "after driving 16.9 s; wanted 17 s")):
        metres = 2 * seconds * 13.89
        file.write_text(f"<net>{road('r', 'a', 'b', metres, f'0,0 {metres},0')}</net>")
        (misfit,) = survey(read_net(file), ("car_following",)).misfits
        assert misfit.why.endswith(says)


@given(wanted=st.floats(0.1, 1e4), share=st.floats(0.0, 1.0, exclude_max=True))
def test_what_is_lacking_is_less_than_what_was_wanted_as_it_is_written(wanted, share):
    if wanted * share < wanted - 1e-6:
        got, above = lacking(wanted * share, "m", wanted).split(" m; wanted ")
        assert float(got) < float(above.removesuffix(" m"))


@pytest.mark.parametrize("place", ["from_south", "from_west"])
@pytest.mark.parametrize(
    ("lane", "share", "fits"),
    [
        ("{own}_1", 1.015, True),
        ("{own}_1", 1.03, False),
        ("{own}_1", 0.5, False),
        ("{own}_2", 1.03, False),  # a neighbour
        ("{own}_0", 2.0, True),  # a sidewalk
        ("{on}_1", 2.0, False),
        (":centre_{straight}_0", 1.06, False),
        (":centre_{pocket}_0", 1.2, True),  # 0.8 m
        (":centre_{pocket}_0", 1.3, False),
    ],
)
def test_a_place_whose_lanes_are_driven_longer_or_shorter_than_drawn_is_refused(tmp_path, place, lane, share, fits):
    south = {"own": "from_south", "on": "to_north", "straight": "9", "pocket": "20"}
    west = {"own": "from_west", "on": "to_east", "straight": "13", "pocket": "22"}
    changed = re.escape(lane.format(**(south if place == "from_south" else west)))
    content, count = re.subn(
        rf'(<lane id="{changed}" [^>]*length=")([\d.]+)',
        lambda found: f"{found[1]}{float(found[2]) * share:.2f}",
        (NETS / "dense" / "dense.net.xml").read_text(),
    )
    assert count == 1
    file = tmp_path / "map.net.xml"
    file.write_text(content)
    says = r"has the length .* and a shape of .*; wanted a difference of at most .* m \(2%, or 1 m\)"
    with nullcontext() if fits else pytest.raises(MapError, match=says):
        place_at(read_net(file), "junction", place)
