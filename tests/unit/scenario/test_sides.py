from pathlib import Path

import pytest

from risk_sac.errors import MapError
from risk_sac.scenario.maps.convert import present_net
from risk_sac.scenario.maps.sides import UNKNOWN, side_remarks
from tests.maps import osm_roundabout, osm_town

STREET = (
    '<way id="{id}"><nd ref="1"/><nd ref="2"/><tag k="highway" v="service"/><tag k="driving_side" v="{side}"/></way>'
)
LEFT_STREET, RIGHT_STREET = STREET.format(id=7, side="left"), STREET.format(id=8, side="right")
RELATION = '<relation id="5"><member type="way" ref="1" role="outer"/><tag k="driving_side" v="left"/></relation>'
UNFINISHED = osm_roundabout(clockwise=True).replace('<nd ref="903"/>', '<nd ref="404"/>')  # beyond the extract's edge


@pytest.fixture
def extract(tmp_path: Path) -> Path:
    return tmp_path / "town.osm"


@pytest.mark.parametrize(
    ("more", "where"),
    [
        (LEFT_STREET, "way 7 has driving_side=left"),
        (RELATION, "relation 5 has driving_side=left"),
        (osm_roundabout(clockwise=True), "the roundabout way 99 runs clockwise"),
        (osm_roundabout(clockwise=False, oneway="-1"), "the roundabout way 99 runs clockwise"),
        (LEFT_STREET + RIGHT_STREET + RELATION, r"way 7 has driving_side=left \(and 1 more like it\)"),
    ],
)
def test_an_extract_with_left_hand_traffic_is_refused_and_says_where(extract: Path, more: str, where: str) -> None:
    extract.write_text(osm_town(more))
    with pytest.raises(MapError, match=f"left-hand traffic: {where}; wanted right-hand"):
        side_remarks(extract)


@pytest.mark.parametrize(
    "more",
    [
        RIGHT_STREET,
        osm_roundabout(clockwise=False),
        osm_roundabout(clockwise=True, oneway="-1"),
        LEFT_STREET + RIGHT_STREET + osm_roundabout(clockwise=False),  # one street has its sides swapped
    ],
)
def test_an_extract_with_right_hand_traffic_is_read_without_a_remark(extract: Path, more: str) -> None:
    extract.write_text(osm_town(more))
    assert side_remarks(extract) == []


@pytest.mark.parametrize("more", ["", osm_roundabout(clockwise=True, oneway="no"), UNFINISHED])
def test_an_extract_that_says_nothing_is_read_as_right_hand_traffic_and_that_is_told(extract: Path, more: str) -> None:
    extract.write_text(osm_town(more))
    assert side_remarks(extract) == [UNKNOWN]


@pytest.mark.parametrize(
    ("rules", "keeps_left"),
    [((), None), (('rule="LHT"',), True), (('rule="RHT"',), False), (("",), False), (('rule="LHT"', "", ""), False)],
)
def test_opendrive_says_by_the_rules_of_its_roads_on_which_side_people_drive(
    extract: Path, rules: tuple[str, ...], keeps_left: bool | None
) -> None:
    roads = "".join(f'<road id="20" {rule}/>' for rule in rules)
    extract.write_text(f"<OpenDRIVE>{roads}</OpenDRIVE>")
    if keeps_left:
        with pytest.raises(MapError, match="left-hand traffic: road 20 has rule=LHT; wanted"):
            side_remarks(extract)
    else:
        assert side_remarks(extract) == ([UNKNOWN] if keeps_left is None else [])


def test_roundabouts_are_read_whatever_comes_first(extract: Path) -> None:
    nodes, mark, ways = osm_roundabout(clockwise=True).partition("<way")
    extract.write_text(f"<osm>{mark}{ways}{nodes}</osm>")
    with pytest.raises(MapError, match="runs clockwise"):
        side_remarks(extract)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ('<!DOCTYPE osm [<!ENTITY a "b">]><osm/>', "got a DOCTYPE"),
        ("<osm><node", "is no map"),
        (f"<osm>{osm_roundabout(clockwise=True).replace('lat=', 'height=')}</osm>", "is no map: KeyError"),
    ],
)
def test_what_is_no_extract_is_refused(extract: Path, content: str, says: str) -> None:
    extract.write_text(content)
    with pytest.raises(MapError, match=says):
        side_remarks(extract)


def test_a_map_is_asked_on_which_side_people_drive_before_it_is_converted(extract: Path, tmp_path: Path) -> None:
    extract.write_text(osm_town(LEFT_STREET))
    with pytest.raises(MapError, match="left-hand traffic"):
        present_net(extract, tmp_path)
    extract.write_text(osm_town())
    assert UNKNOWN in present_net(extract, tmp_path).warnings
