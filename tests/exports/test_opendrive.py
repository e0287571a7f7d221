"""Exports of nets with heights: lanes, bodies and links as in SUMO."""

import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from risk_sac.failures.export.formats import FormatName, export
from risk_sac.failures.export.opendrive import opendrive
from risk_sac.failures.export.recorded import Recorded
from risk_sac.world.net import Net
from risk_sac.world.read_net import read_net
from tests.exports.read_opendrive import dangling, middles
from tests.exports.test_mcap import read

BESIDE_M, HEIGHT_M = 0.2, 0.1
NODES = """<nodes>
<node id="c" x="0" y="0" z="5" type="traffic_light"/><node id="a" x="-100" y="0" z="0"/>
<node id="b" x="100" y="10" z="9"/><node id="d" x="0" y="100" z="7"/><node id="e" x="5" y="-90" z="2"/></nodes>"""
EDGES = """<edges>
<edge id="ac" from="a" to="c" numLanes="3" sidewalkWidth="2"/><edge id="ca" from="c" to="a" numLanes="2"/>
<edge id="cb" from="c" to="b" numLanes="2" shape="0,0,5 40,-8,7 70,5,8 100,10,9"/>
<edge id="bc" from="b" to="c" numLanes="2"/><edge id="cd" from="c" to="d"/><edge id="dc" from="d" to="c" numLanes="2"/>
<edge id="ce" from="c" to="e" numLanes="2"/><edge id="ec" from="e" to="c" numLanes="2"/></edges>"""
BENT = """<edges><edge id="cb" from="c" to="b" numLanes="3" shape="0,0,5 50,0,6 50,30,8 75,30,8 100,10,9"/></edges>"""


def built(folder: Path, edges: str) -> Net:
    """The net that netconvert makes of some edges."""
    (folder / "n.xml").write_text(NODES)
    (folder / "e.xml").write_text(edges)
    command = [Path(sys.executable).parent / "netconvert", "-n", "n.xml", "-e", "e.xml", "-o", "net.xml"]
    subprocess.run([*command, "--crossings.guess"], cwd=folder, check=True, capture_output=True)
    return read_net(folder / "net.xml")


@pytest.mark.parametrize("edges", [EDGES, BENT], ids=["junction on a hill", "sharp bends"])
def test_lanes_lie_where_sumos_do_at_their_height_and_links_lead_somewhere(tmp_path: Path, edges: str) -> None:
    net = built(tmp_path, edges)
    root = ET.fromstring(opendrive(net, "hill"))
    found = middles(root)
    lanes = [lane for lane in net.lanes.values() if lane.use != "crossing"]
    lines = [shapely.LineString(points[:, :2]) for points in found]
    assert len(root.findall("road")) >= len({lane.edge for lane in lanes if not lane.edge.startswith(":")})
    for lane in lanes:
        points = shapely.points(shapely.get_coordinates(shapely.segmentize(shapely.LineString(lane.centre), 0.5)))
        apart = [shapely.distance(points, line).max() for line in lines]
        nearest = found[int(np.argmin(apart))]
        assert min(apart) < BESIDE_M, lane.id
        for place, height in zip(lane.centre, lane.height_m, strict=True):
            there = nearest[np.hypot(*(nearest[:, :2] - place).T).argmin(), 2]
            assert there == pytest.approx(height, abs=HEIGHT_M), lane.id
    every = shapely.MultiLineString([lane.centre for lane in lanes])
    assert max(shapely.distance(shapely.points(points[:, :2]), every).max() for points in found) < BESIDE_M
    assert dangling(root) == []


def test_bodies_stand_on_the_ground_of_a_slope(failure: Callable[[str], Recorded]) -> None:
    flat = failure("low")
    lanes = {id_: replace(lane, height_m=tuple(x / 50 for x, _ in lane.line)) for id_, lane in flat.net.lanes.items()}
    net = replace(flat.net, lanes=lanes)
    actors = tuple(replace(actor, z_m=net.heights_m(np.column_stack((actor.x_m, actor.y_m)))) for actor in flat.actors)
    hill = replace(flat, net=net, actors=actors)
    for actor in actors:
        np.testing.assert_allclose(actor.z_m, actor.x_m / 50, atol=1e-9)
    scenario = ET.fromstring(export(FormatName.OPENSCENARIO, hill)["failure-as-recorded.xosc"])
    places = [place for vertex in scenario.iter("Vertex") for place in vertex.iter("WorldPosition")]
    assert len(places) == sum(len(actor.time_s) for actor in actors)
    ahead_m = 0.5 * 6.0  # a place is that of the rear axle, at most so far behind the middle
    assert all(abs(float(each.attrib["z"]) - float(each.attrib["x"]) / 50) < ahead_m / 50 for each in places)
    topics, _ = read((export(FormatName.MCAP, hill))[f"{hill.name}.mcap"])
    for _, scene in topics["/actors"]:
        for body in (shape for entity in scene.entities for shape in (*entity.cubes, *entity.cylinders)):
            place = body.pose.position
            assert place.z - body.size.z / 2 == pytest.approx(place.x / 50, abs=1e-6)
