"""OpenDRIVE: what netconvert makes of the net, as version 1.7 of the standard has it."""

import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from risk_sac.errors import ConfigError
from risk_sac.failures.export.beside import BESIDE
from risk_sac.failures.export.markup import document

WALL_S = 120.0  # a second suffices


def opendrive(net: Path, name: str) -> bytes:
    """The roads of a net.

    Args:
      net: file of SUMO's.
      name: of the map.

    Raises:
      ConfigError: netconvert cannot tell this net in OpenDRIVE.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "roads.xodr"
        _netconvert("--sumo-net-file", str(net), "--opendrive-output", str(file))
        root = ET.parse(file).getroot()
    return document(_as_of_1_7(root, name))


def _netconvert(*options: str) -> None:
    """Through its Python entry, which finds the binary wherever the wheel put it."""
    command = [sys.executable, "-c", "import sys, sumo; sys.exit(sumo.netconvert())", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=WALL_S)
    if done.returncode:
        why = (done.stderr.strip().splitlines() or ["it ended without a word"])[0]
        raise ConfigError(f"netconvert cannot write this net as OpenDRIVE: {why}", field="format")


def _as_of_1_7(root: ET.Element, name: str) -> ET.Element:
    """What netconvert calls 1.4 has some of what came later, and no version's schema takes it as it stands."""
    header = root.find("header")
    assert header is not None
    header.attrib |= {"revMinor": "7", "name": name}
    header.attrib.pop("date", None)  # the same net is the same file
    header.append(ET.Comment(f" {BESIDE} has what is not in this file "))
    for thing in root.iter("object"):  # crossings: required since 1.7
        thing.attrib.setdefault("zOffset", "0")
    for road in root.iter("road"):
        _measure(road)
    return root


def _measure(road: ET.Element) -> None:
    """Lengths of curves as they are: netconvert tells that of the polyline through some of their points."""
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
