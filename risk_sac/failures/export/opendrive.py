"""Writes OpenDRIVE 1.7: what netconvert makes of the net, with turns laid along SUMO's lanes."""

import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from risk_sac.errors import ConfigError
from risk_sac.failures.export.written import BESIDE, document
from risk_sac.failures.net import Net, boundaries
from risk_sac.run_folder.scratch import scratch_folder
from risk_sac.types import Floats

WALL_S = 120.0  # a second suffices


def opendrive(file: Path, net: Net, name: str) -> bytes:
    """Returns the roads of a net under the map's name; a ConfigError if netconvert cannot write them."""
    with scratch_folder() as folder:
        shutil.copy(file, folder / "net.xml")
        _netconvert(folder, "--sumo-net-file", "net.xml", "--opendrive-output", "roads.xodr")
        root = ET.parse(folder / "roads.xodr").getroot()
    for road in root.iter("road"):
        lane = _turning(road, net)
        if lane is not None:
            _lay(road, *lane)
        _measure(road)
    return document(_as_of_1_7(root, name))


def _netconvert(folder: Path, *options: str) -> None:
    """Runs netconvert through its Python entry, which finds the wheel's binary, in the folder of its files."""
    command = [sys.executable, "-c", "import sys, sumo; sys.exit(sumo.netconvert())", *options]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=WALL_S)
    if done.returncode:
        why = (done.stderr.strip().splitlines() or ["it ended without a word"])[0]
        raise ConfigError("format", f"netconvert cannot write this net as OpenDRIVE: {why}")


def _as_of_1_7(root: ET.Element, name: str) -> ET.Element:
    """Completes what netconvert calls 1.4, which fits no version's schema."""
    header = root.find("header")
    assert header is not None
    header.attrib |= {"revMinor": "7", "name": name}
    header.attrib.pop("date", None)  # the same net is the same file
    header.append(ET.Comment(f" {BESIDE} has what is not in this file "))
    for thing in root.iter("object"):  # crossings: required since 1.7
        thing.attrib.setdefault("zOffset", "0")
    return root


def _turning(road: ET.Element, net: Net) -> tuple[Floats, float] | None:
    """Returns middle and width of the leftmost lane of a road that bends inside a junction."""
    edge = road.get("name", "")  # as SUMO's
    lanes = [lane for lane in net.lanes.values() if lane.edge == edge and lane.use == "inside"]
    if not lanes or road.find("planView/geometry/paramPoly3") is None:
        return None
    lane = max(lanes, key=lambda each: each.index)
    line, width_m = [lane.centre], lane.width_m
    while (after := next((net.lanes[name] for name in lane.next if name in net.lanes), None)) and after.use == "inside":
        line.append(after.centre[1:])  # SUMO divides a turn where vehicles wait within the junction
        lane = after
    return np.concatenate(line), width_m


def _lay(road: ET.Element, middle: Floats, width_m: float) -> None:
    """Lays a road's reference line along the left edge of a lane, as cubics through all of its points.

    netconvert bends one cubic from end to end, up to 11 cm beside the lane that SUMO's vehicles drive on.
    """
    plan = road.find("planView")
    assert plan is not None  # that of a road that bends
    edge = boundaries(middle, width_m)[0]
    edge[[0, -1]], ends = _ends(plan[0])  # where the roads before and after it end, and the way they do
    station = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(edge, axis=0), axis=1))))
    through = CubicSpline(station, edge, bc_type=((1, ends[0]), (1, ends[1])))
    plan.clear()
    for piece, length_m in enumerate(np.diff(station)):
        cubic, square, slope, start = through.c[:, piece]
        heading = np.arctan2(slope[1], slope[0])
        into = np.array([(np.cos(heading), -np.sin(heading)), (np.sin(heading), np.cos(heading))])  # the piece's frame
        place = {"s": "0", "x": repr(float(start[0])), "y": repr(float(start[1])), "hdg": repr(float(heading))}
        geometry = ET.SubElement(plan, "geometry", place)
        curve = {"pRange": "normalized", "aU": "0", "aV": "0"}
        for name, power, slopes in (("b", 1, slope), ("c", 2, square), ("d", 3, cubic)):
            u, v = slopes @ into * length_m**power
            curve |= {f"{name}U": repr(float(u)), f"{name}V": repr(float(v))}
        ET.SubElement(geometry, "paramPoly3", curve)


def _ends(geometry: ET.Element) -> tuple[Floats, Floats]:
    """Both ends of a normalised cubic, and its unit direction there, `2 x 2` each."""
    heading = float(geometry.get("hdg", "0"))
    outward = np.array([(np.cos(heading), np.sin(heading)), (-np.sin(heading), np.cos(heading))])
    a, b, c, d = (np.array([float(geometry[0].get(f"{name}{axis}", "0")) for axis in "UV"]) for name in "abcd")
    places = np.array([a, a + b + c + d]) @ outward + (float(geometry.get("x", "0")), float(geometry.get("y", "0")))
    directions = np.array([b, b + 2.0 * c + 3.0 * d]) @ outward
    return places, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _measure(road: ET.Element) -> None:
    """Corrects the lengths of curves: netconvert writes that of a polyline."""
    begins_m = 0.0
    for geometry in road.iter("geometry"):
        curve = geometry.find("paramPoly3")
        if curve is not None:
            geometry.set("length", repr(_length(curve)))
        geometry.set("s", repr(begins_m))
        begins_m += float(geometry.get("length", "0"))
    road.set("length", repr(begins_m))


def _length(curve: ET.Element) -> float:
    """Of a normalised cubic, m, by Gauss-Legendre quadrature."""
    places, weights = np.polynomial.legendre.leggauss(32)
    p = (places + 1.0) / 2.0
    slopes = []
    for axis in "UV":
        b, c, d = (float(curve.get(f"{name}{axis}", "0")) for name in "bcd")
        slopes.append(b + 2.0 * c * p + 3.0 * d * p**2)
    return float(np.hypot(*slopes) @ weights / 2.0)
