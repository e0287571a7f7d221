from pathlib import Path

import libsumo
import numpy as np
import pytest

import sumo_nets
from risk_sac.errors import ConfigError, MapError
from risk_sac.scenario import library
from risk_sac.scenario.families import FAMILIES, SHIPPED, family_at, family_named
from risk_sac.scenario.maps.convert import present_net
from risk_sac.scenario.maps.finder import place_at, survey
from risk_sac.scenario.maps.keep import Map
from risk_sac.scenario.maps.net import read_net
from risk_sac.scenario.place import PLACES, CrossingPlace, JunctionPlace, Stretch
from tests.maps import osm_town

NETS = Path(sumo_nets.__path__[0])
LANE = '<lane id="{id}_0" index="0" speed="13.89" length="{m}" shape="{line}"/>'
ROAD = '<edge id="{id}" from="{a}" to="{b}">' + LANE + "</edge>"
RAILS = (
    '<edge id="r" from="a" to="b"><lane id="r_0" index="0" allow="rail" speed="9" length="9" shape="0,0 9,0"/></edge>'
)


def shipped(name: str):
    return PLACES.validate_json((NETS / name / "place.json").read_bytes())


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Map:
    folder = tmp_path_factory.mktemp("town")
    (folder / "town.osm").write_text(osm_town())
    return Map(present_net(folder / "town.osm", folder).file)


def test_the_finder_finds_the_place_of_the_junction_that_is_shipped() -> None:
    found = place_at(read_net(NETS / "dense" / "dense.net.xml"), "junction", "from_south").place
    ours = shipped("dense")
    assert isinstance(found, JunctionPlace)
    assert found.ego == ours.ego
    assert found.others == ours.others
    assert found.signal == ours.signal
    assert [stream.track for stream in found.streams] == [stream.track for stream in ours.streams]
    # The finder leaves room for cars that turn round the corner.
    assert (found.walk.x_m, found.walk.y_m) == pytest.approx((ours.walk.x_m, ours.walk.y_m), abs=1.0)
    assert (found.walk.along_x, found.walk.along_y) == pytest.approx((ours.walk.along_x, ours.walk.along_y))
    family, theirs = family_at("dense", found), FAMILIES["dense"]
    assert family.space == theirs.space
    assert family.odd == theirs.odd


@pytest.mark.parametrize(("edge", "site"), [("e1", 0), ("e2", 1)])
def test_the_finder_finds_the_crossings_that_are_shipped(edge: str, site: int) -> None:
    found = place_at(read_net(NETS / "mixed" / "mixed.net.xml"), "crossing", edge).place
    assert isinstance(found, CrossingPlace)
    ours = shipped("mixed").sites[site]
    for name in ("ego", "occluder"):
        (mine,), (theirs,) = getattr(found.sites[0], name).pieces, getattr(ours, name).pieces[-1:]
        assert (mine.edge, mine.lane, mine.length_m) == (theirs.edge, theirs.lane, theirs.length_m)
        assert mine.reach_m == pytest.approx(theirs.reach_m)
    assert found.sites[0].signalised == ours.signalised
    assert {piece.edge for track in found.sites[0].oncoming for piece in track.pieces[-1:]} == {
        track.pieces[-1].edge for track in ours.oncoming
    }
    assert (found.sites[0].walk.x_m, found.sites[0].walk.y_m) == pytest.approx((ours.walk.x_m, ours.walk.y_m))


def test_the_finder_finds_the_road_that_is_shipped() -> None:
    found = place_at(read_net(NETS / "low" / "low.net.xml"), "car_following", "road").place
    assert isinstance(found, Stretch)
    assert family_at("low", found).space == FAMILIES["low"].space
    assert family_at("low", found).odd == FAMILIES["low"].odd


def test_ground_that_is_found_is_the_ground_that_was_drawn_by_hand() -> None:
    found = place_at(read_net(NETS / "dense" / "dense.net.xml"), "junction", "from_south").place
    mine, ours = family_at("dense", found), FAMILIES["dense"]
    middle = ours.space.from_unit(np.full(ours.space.dimension, 0.5)).values
    layouts = mine.layout(middle), ours.layout(middle)
    points = np.random.default_rng(2).uniform((-7.9, -30.0), (7.9, -4.0), (300, 2))  # the ego's road and its crossing
    for x, y in points:
        for name in ("crossings", "junctions")[: 1 if y < -15.5 else 2]:  # netconvert's junction has its crossings
            here = [any(area.grown(by).contains(x, y) for area in getattr(layouts[1], name)) for by in (-0.1, 0.1)]
            if here[0] == here[1]:  # not on the edge, of which 5 cm were taken
                assert any(area.contains(x, y) for area in getattr(layouts[0], name)) == here[0], (name, x, y)


def test_a_town_has_places_of_all_patterns_and_each_is_kept_as_a_small_net(town: Map, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    found = survey(town.net)
    assert set(found.counts) == {"car_following", "crossing", "junction"}
    assert all(misfit.why for misfit in found.misfits)
    for fit in (found.fits[0], found.fits[-1]):
        name = town.keep(fit)
        assert town.keep(fit) == name
        family = family_named(name)
        layout = family.layout(family.space.from_unit(np.full(family.space.dimension, 0.5)).values)
        libsumo.start(["sumo", "-n", layout.net, "--no-step-log", "--no-warnings"])
        try:
            for start in (layout.ego, *layout.vehicles):
                assert start.position_m <= libsumo.lane.getLength(f"{start.route[0]}_{start.lane}")
                assert libsumo.simulation.findRoute(start.route[0], start.route[-1]).edges
        finally:
            libsumo.close()


def test_a_kept_place_that_was_changed_is_refused(town: Map, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv(library.VARIABLE, str(tmp_path))
    name = town.keep(survey(town.net, ("junction",)).fits[0])
    net = tmp_path / name / library.NET
    net.write_bytes(net.read_bytes() + b" ")
    with pytest.raises(ConfigError, match="damaged"):
        library.kept(name)
    with pytest.raises(ConfigError, match="there is no place 'junction_000000000000'"):
        family_named("junction_000000000000")


def test_names_of_shipped_families_and_of_places_are_told_apart() -> None:
    assert set(FAMILIES) == set(SHIPPED)


def road(id_: str, a: str, b: str, metres: float, line: str) -> str:
    return ROAD.format(id=id_, a=a, b=b, m=metres, line=line)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("<net><edge", "is no XML"),
        ("<routes/>", "the root of .* is <routes>"),
        ("<net/>", "none of the 0 edges has a lane for passenger cars"),
        (f'<net lefthand="true">{road("r", "a", "b", 900, "0,0 900,0")}</net>', "left-hand traffic"),
        (f"<net>{RAILS}</net>", "none of the 1 edges has a lane for passenger cars"),
        (
            f"<net>{road('r', 'a', 'b', 90, '0,0 90,0')}{road('s', 'b', 'c', 90, '90,0 180,0')}</net>",
            "roads meet, but no lane leads on",
        ),
        ('<net><edge id="r" from="a" to="b"><lane id="r_0" index="0"/></edge></net>', "no net of the present format"),
    ],
)
def test_a_map_that_nothing_fits_on_says_why(tmp_path: Path, content: str, says: str) -> None:
    file = tmp_path / "map.net.xml"
    file.write_text(content)
    with pytest.raises(MapError, match=says):
        read_net(file)


def test_a_place_that_cannot_be_run_says_why(tmp_path: Path) -> None:
    file = tmp_path / "map.net.xml"
    file.write_text(f"<net>{road('short', 'a', 'b', 90, '0,0 90,0')}</net>")
    with pytest.raises(MapError, match="the longest way on that was found ends with edge 'short' after 6 s"):
        place_at(read_net(file), "car_following", "short")
    with pytest.raises(MapError, match="the map has no edge 'x'"):
        place_at(read_net(file), "car_following", "x")
    with pytest.raises(MapError, match="junction does not fit at 'short': wanted a road to a junction"):
        place_at(read_net(file), "junction", "short")


@pytest.mark.parametrize(
    ("content", "says"),
    [("<html/>", "root <html>"), ("nothing", "no XML"), ("<osm/>", "netconvert cannot convert")],
)
def test_what_is_no_map_is_not_converted(tmp_path: Path, content: str, says: str) -> None:
    file = tmp_path / "map"
    file.write_text(content)
    with pytest.raises(MapError, match=says):
        present_net(file, tmp_path)
