from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import UploadError
from service.networks.checker import document
from service.networks.checker.check import rewrite
from service.networks.checker.document import Attributes, read, root_of
from service.networks.checker.roads import Demand, Net
from tests.hostile_networks import EAST, NET, ROAD

NETS = sorted(Path("sumo_nets").glob("*/*.net.xml"))
XSI = "{http://www.w3.org/2001/XMLSchema-instance}"


class Nobody:
    """Watches nothing."""

    def element(self, tag: str, attributes: Attributes, parent: str) -> None:
        pass


def rewritten(data: bytes, kind: str = "net") -> str:
    return read(data, kind, Nobody()).text


def listed(text: bytes) -> list[tuple[str, dict[str, str]]]:
    elements = ET.fromstring(text).iter()
    return [(e.tag, {k: v for k, v in e.attrib.items() if not k.startswith(XSI)}) for e in elements]


@pytest.mark.parametrize("net", NETS, ids=lambda path: path.name)
def test_what_is_written_anew_says_the_same(net: Path) -> None:
    data = net.read_bytes()
    assert listed(rewritten(data).encode()) == listed(data)
    assert rewritten(rewritten(data).encode()) == rewritten(data)


@given(st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="$"), max_size=50))
def test_a_name_survives_being_written_anew(name: str) -> None:
    if not name.isprintable():
        return
    root = ET.fromstring(NET)
    root[0].set("name", name)
    [edge] = ET.fromstring(rewritten(ET.tostring(root))).findall("edge")
    assert edge.get("name") == name


def test_comments_instructions_and_schemas_are_left_out() -> None:
    schema = '<net xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="http://x/y.xsd"'
    noisy = f"<!-- a --><?evil b?>{NET.replace('<net', schema)}<!-- c -->"
    assert rewritten(noisy.encode()) == rewritten(NET.encode())


def test_a_refusal_names_the_line_the_element_and_what_was_wanted() -> None:
    with pytest.raises(UploadError, match=r"^line 3: speed of <lane> is 'fast'; wanted a number from 0 to 500$"):
        rewritten(NET.replace('speed="13.89"', 'speed="fast"').replace("<edge", "\n\n<edge").encode())


def test_the_root_is_told_without_reading_on() -> None:
    assert root_of(b"<!-- first --><routes><unclosed>") == "routes"
    with pytest.raises(UploadError, match="DOCTYPE"):
        root_of(b"<!DOCTYPE routes><routes/>")


def test_elements_are_counted_over_all_documents(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document, "MAX_ELEMENTS", 9)
    assert read(NET.encode(), "net", Nobody(), 4).elements == 5
    with pytest.raises(UploadError, match="more than 9 elements"):
        read(NET.encode(), "net", Nobody(), 5)


def test_an_upload_may_have_no_more_elements_than_one_document(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    routes = b"<routes><person id='p' depart='0'/></routes>"
    monkeypatch.setattr(document, "MAX_ELEMENTS", 7)
    assert [file.elements for file in rewrite([NET.encode(), routes])[0]] == [5, 2]
    with pytest.raises(UploadError, match="more than 7 elements"):
        rewrite([NET.encode(), routes, routes])


def watched(text: str, kind: str, observer: document.Observer) -> None:
    read(text.encode(), kind, observer)


def test_a_summary_counts_roads_and_not_what_lies_inside_junctions() -> None:
    net = Net()
    watched(NETS[0].read_text(), "net", net)
    summary = net.finish()
    assert (NETS[0].name, summary.edges, summary.junctions, summary.lanes) == ("dense.net.xml", 8, 5, 24)
    assert summary.length_m == pytest.approx(1843.2)
    assert summary.bounding_box == (-250.0, -250.0, 250.0, 250.0)


def demand() -> Demand:
    net = Net()
    watched(NET, "net", net)
    net.finish()
    return Demand(net)


@pytest.mark.parametrize(
    "text",
    [
        '<vehicle id="v" depart="0"><route edges="road"/><stop lane="road_0" endPos="5" duration="-1"/></vehicle>',
        '<flow id="f" from="road" to="road" begin="0" end="60" period="exp(0.2)" departLane="best"/>',
        '<person id="p" depart="0"><walk edges="road"/><ride from="road" to="road" lines="ANY"/></person>',
        '<vType id="t" vClass="bicycle" speedFactor="normc(1,0.1,0.2,2)" emissionClass="zero" color="1,0.5,0"/>',
    ],
)
def test_usual_traffic_is_taken(text: str) -> None:
    watched(f"<routes>{text}</routes>", "routes", demand())


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda net: net.replace(EAST, ""), "edge 'road' names the junction 'east'"),
        (lambda net: net.replace("road_0", "lane", 1), "junction 'east' names the lane 'road_0'"),
        (lambda net: net.replace(ROAD, ""), "junction 'east' names the lane 'road_0'"),
    ],
)
def test_a_net_refers_only_to_what_it_has(change: Callable[[str], str], says: str) -> None:
    net = Net()
    watched(change(NET), "net", net)
    with pytest.raises(UploadError, match=says):
        net.finish()
