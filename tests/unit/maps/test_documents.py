import bz2
import contextlib
import gzip
import lzma
import random
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import sumo_nets
from risk_sac.errors import MapError
from risk_sac.maps import convert, documents
from risk_sac.maps.convert import present_net
from risk_sac.maps.documents import SIDE_UNKNOWN, rewritten
from tests.hostile_networks import ADDITIONAL, NET, ROUTES, zipped
from tests.maps import osm_town

PBF = b"\0\0\0\x0d\n\tOSMHeader\x18\x7c" + bytes(90)


NETS = sorted(Path(sumo_nets.__path__[0]).glob("*/*.net.xml"))
PACKED = {
    "xml": NET.encode(),
    "gzip": gzip.compress(NET.encode()),
    "zip": zipped(NET, ROUTES, "", names=("nets/a.net.xml", "b.rou.xml", "nets/")),
}


def written(content: bytes | str, folder: Path) -> list[str]:
    upload = folder / "upload"
    upload.write_bytes(content.encode() if isinstance(content, str) else content)
    return [document.file.read_text("utf-8") for document in rewritten(upload, folder, "the map")]


def listed(text: str) -> list[tuple[str, dict[str, str]]]:
    return [(e.tag, {k: v for k, v in e.attrib.items() if not k.startswith("{")}) for e in ET.fromstring(text).iter()]


@pytest.mark.parametrize("net", NETS, ids=lambda path: path.name)
def test_what_is_written_again_says_the_same(net, tmp_path):
    (once,) = written(net.read_bytes(), tmp_path)
    assert listed(once) == listed(net.read_text())
    assert written(once, tmp_path) == [once]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=50))
def test_a_name_survives_unless_it_hides_a_variable_or_turns_text(name, tmp_path):
    root = ET.fromstring(NET)
    root[0].set("name", name)
    (text,) = written(ET.tostring(root), tmp_path)
    kept = ET.fromstring(text)[0].get("name", "")
    assert "${" not in kept
    assert kept.isprintable()
    if name.isprintable():
        assert kept == name.replace("${", "_{")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "iso-8859-1"])
def test_a_map_is_read_in_any_encoding(encoding, tmp_path):
    text = f'<?xml version="1.0" encoding="{encoding.removesuffix("-sig")}"?>\r\n{NET.replace("road", "Straße")}'
    assert listed(*written(text.encode(encoding), tmp_path)) == listed(NET.replace("road", "Straße"))


def test_comments_text_and_schemas_are_left_out_and_unknown_elements_are_told(tmp_path):
    schema = '<net xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="http://x/y.xsd"'
    noisy = NET.replace("<net", schema).replace("</net>", "text<viewsettings><zoom/></viewsettings></net>")
    (tmp_path / "upload").write_text(f"<!-- a --><?evil b?>{noisy}<!-- c -->")
    (document,) = rewritten(tmp_path / "upload", tmp_path, "the map")
    assert listed(document.file.read_text()) == listed(NET)
    assert document.remarks == ("left out, because they are no part of a map: <viewsettings> (1)",)


@pytest.mark.parametrize("packing", PACKED)
def test_documents_come_out_of_a_package_as_they_went_in(packing, tmp_path):
    files = [NET, ROUTES][: 2 if packing == "zip" else 1]
    assert [listed(text) for text in written(PACKED[packing], tmp_path)] == [listed(file) for file in files]


@pytest.mark.parametrize("packing", ["gzip", "zip"])
def test_damage_of_any_kind_is_refused_and_nothing_else_happens(packing, tmp_path):
    generator = random.Random(4)
    refused = 0
    for _ in range(300):
        content = bytearray(PACKED[packing])
        for _ in range(generator.randint(1, 4)):
            content[generator.randrange(len(content))] = generator.randrange(256)
        if generator.random() < 0.2:
            del content[generator.randrange(len(content)) :]
        refused += 1
        with contextlib.suppress(MapError):
            written(bytes(content), tmp_path)
            refused -= 1
    assert refused > 250


def test_all_files_of_an_archive_count_together(tmp_path, monkeypatch):
    monkeypatch.setattr(documents, "MAX_BYTES", len(NET) + len(ROUTES))
    assert len(written(zipped(NET, ROUTES), tmp_path)) == 2
    with pytest.raises(MapError, match="what unpacks to more than"):
        written(zipped(NET, ROUTES, ADDITIONAL), tmp_path)


@pytest.mark.parametrize("name", ["NULL", "NUL", "/dev/null", ""])
def test_an_output_that_is_switched_off_is_left_out(name: str, tmp_path: Path) -> None:
    off, kept = f'<param key="file" value="{name}"/>', '<param key="max-gap" value="3.0"/>'
    light = f'<tlLogic id="east" type="actuated">{kept}{{off}}<phase duration="9" state="G"/></tlLogic></net>'
    detector = f'<e1Detector id="d" lane="road_0" file="{name}"/><poly id="p" shape="0,0 1,1"{{imgFile}}/></additional>'
    net, more = NET.replace("</net>", light), f"<additional>{detector}"
    packed = zipped(net.replace("{off}", off), more.replace("{imgFile}", f' imgFile="{name}"'))
    poly = '<additional><poly id="p" shape="0,0 1,1"/></additional>'
    assert [listed(text) for text in written(packed, tmp_path)] == [listed(net.replace("{off}", "")), listed(poly)]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (bz2.compress(NET.encode()), "the map, which is packed by bzip2; wanted XML.* convert it: bunzip2 "),
        (lzma.compress(NET.encode()), "the map, which is packed by xz; wanted XML.* convert it: unxz "),
        (PBF, "the map, which is OpenStreetMap's PBF; wanted XML.* convert it: osmium cat MAP.osm.pbf -o MAP.osm"),
        (gzip.compress(PBF), "the map, which is OpenStreetMap's PBF"),
        (b"\xff\xe0\x04o5m2" + bytes(90), "the map, which is OpenStreetMap's o5m"),
    ],
    ids=["bzip2", "xz", "pbf", "packed pbf", "o5m"],
)
def test_a_map_in_another_packing_is_told_the_command_that_converts_it(
    content: bytes, says: str, tmp_path: Path
) -> None:
    with pytest.raises(MapError, match=says):
        written(content, tmp_path)


def osm_sides(*sides: str) -> str:
    ways = (f'<way><tag k="highway" v="service"/><tag k="driving_side" v="{side}"/></way>' for side in sides)
    return f"<osm>{''.join(ways)}</osm>"


def opendrive_rules(*rules: str) -> str:
    return f"<OpenDRIVE>{''.join(f'<road {rule}/>' for rule in rules)}</OpenDRIVE>"


LHT, RHT = 'rule="LHT"', 'rule="RHT"'


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (osm_sides("left"), "driving_side=left"),
        (osm_sides("left", "right"), "driving_side=left"),
        (osm_sides("none").replace("</osm>", '<relation><tag k="driving_side" v="left"/></relation></osm>'), "line 1"),
        (opendrive_rules(LHT), "rule=LHT"),
        (opendrive_rules(RHT, LHT), "rule=LHT"),
    ],
)
def test_a_map_that_states_left_hand_traffic_is_refused_with_its_reason(text, reason, tmp_path):
    with pytest.raises(MapError) as refused:
        written(text.encode(), tmp_path)
    assert refused.value.field == "network"
    assert reason in str(refused.value)


@pytest.mark.parametrize(
    ("text", "remarks"),
    [
        (osm_sides("right", "left", "right"), ()),
        (osm_sides("none"), (SIDE_UNKNOWN,)),
        (opendrive_rules("", LHT, RHT), ()),
        (NET, ()),
    ],
)
def test_any_other_map_is_read_as_right_hand_and_says_if_it_states_no_side(text, remarks, tmp_path):
    (tmp_path / "upload").write_text(text)
    (document,) = rewritten(tmp_path / "upload", tmp_path, "the map")
    assert document.remarks == remarks


@pytest.mark.parametrize(
    ("script", "says"),
    [
        ("kill -SEGV $$", r"\(SIGSEGV\)"),
        ("kill -KILL $$", "time or memory"),
        ("echo 'Error: no nodes' >&2; exit 1", "no nodes"),
    ],
)
def test_why_netconvert_failed_is_told(tmp_path, monkeypatch, script, says):
    program, file = tmp_path / "netconvert", tmp_path / "map.osm"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    file.write_text(osm_town())
    monkeypatch.setattr(convert, "netconvert", lambda: (str(program), {}))
    with pytest.raises(MapError, match=says):
        present_net(file, tmp_path)
