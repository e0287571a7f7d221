import pytest

from risk_sac.errors import MapError
from risk_sac.maps.sides import UNKNOWN, side_remarks
from tests.maps import osm_roundabout, osm_town

STREET = (
    '<way id="{id}"><nd ref="1"/><nd ref="2"/><tag k="highway" v="service"/><tag k="driving_side" v="{side}"/></way>'
)
LEFT_STREET, RIGHT_STREET = STREET.format(id=7, side="left"), STREET.format(id=8, side="right")
RELATION = '<relation id="5"><member type="way" ref="1" role="outer"/><tag k="driving_side" v="left"/></relation>'

MINI = '<node id="71" lat="48.7" lon="11.4"><tag k="highway" v="mini_roundabout"/><tag k="direction" v="{}"/></node>'


def carriageways(side: int) -> str:
    """Two carriageways of one road, 15 m apart, each with the other on its left (1) or its right (-1)."""
    road = '<tag k="highway" v="motorway"/><tag k="ref" v="A 9"/>'
    nodes = "".join(
        f'<node id="{81 + i + 3 * j}" lat="{48.7 + side * j * 15 / 111_320:.7f}" lon="{11.4 + 0.002 * i}"/>'
        for i in range(3)
        for j in range(2)
    )
    there, back = (f'<nd ref="{a}"/><nd ref="{b}"/><nd ref="{c}"/>' for a, b, c in ((81, 82, 83), (86, 85, 84)))
    return f'{nodes}<way id="61">{there}{road}</way><way id="62">{back}{road}</way>'


@pytest.fixture
def extract(tmp_path):
    return tmp_path / "town.osm"


@pytest.mark.parametrize(
    ("more", "where"),
    [
        (LEFT_STREET, "way 7 has driving_side=left"),
        (RELATION, "relation 5 has driving_side=left"),
        (osm_roundabout(clockwise=True), "the roundabout way 99 runs clockwise"),
        (osm_roundabout(clockwise=False, oneway="-1"), "the roundabout way 99 runs clockwise"),
        (
            LEFT_STREET + RIGHT_STREET + RELATION,
            r"way 7 has driving_side=left \(and 1 more like it\), although way 8 has driving_side=right",
        ),
        (osm_roundabout(clockwise=True, pieces=2), "the roundabout way 99 runs clockwise"),
        (osm_roundabout(clockwise=True, pieces=3), "the roundabout way 99 runs clockwise"),
        (osm_roundabout(clockwise=True, pieces=6), "the roundabout way 99 runs clockwise"),
        (MINI.format("clockwise"), "the mini-roundabout node 71 runs clockwise"),
        (carriageways(-1), "the carriageways of A 9 are driven on the left"),
    ],
)
def test_an_extract_with_left_hand_traffic_is_refused_and_says_where(extract, more, where):
    extract.write_text(osm_town(more))
    with pytest.raises(MapError, match=f"left-hand traffic: {where}; wanted right-hand"):
        side_remarks(extract)


@pytest.mark.parametrize(
    ("rules", "keeps_left"),
    [((), None), (('rule="LHT"',), True), (('rule="RHT"',), False), (("",), False), (('rule="LHT"', "", ""), False)],
)
def test_opendrive_says_by_the_rules_of_its_roads_on_which_side_people_drive(extract, rules, keeps_left):
    roads = "".join(f'<road id="20" {rule}/>' for rule in rules)
    extract.write_text(f"<OpenDRIVE>{roads}</OpenDRIVE>")
    if keeps_left:
        with pytest.raises(MapError, match="left-hand traffic: road 20 has rule=LHT; wanted"):
            side_remarks(extract)
    else:
        (said,) = side_remarks(extract)
        assert said == UNKNOWN if keeps_left is None else said.startswith("right-hand traffic: road 20 has rule=RHT")


def test_roundabouts_are_read_whatever_comes_first(extract):
    nodes, mark, ways = osm_roundabout(clockwise=True).partition("<way")
    extract.write_text(f"<osm>{mark}{ways}{nodes}</osm>")
    with pytest.raises(MapError, match="runs clockwise"):
        side_remarks(extract)
