import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

import sumo_nets
from risk_sac.scenario.layout import CAR_LENGTH_M, CAR_WIDTH_M, TRUCK_LENGTH_M, TRUCK_WIDTH_M

NETS = Path(sumo_nets.__path__[0])


def test_rebuilding_the_nets_gives_the_same_bytes(tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    if shutil.which("netconvert", path=path) is None:
        pytest.skip("netconvert is not installed")
    committed = {net.name: net.read_bytes() for net in NETS.glob("*/*.net.xml")}
    shutil.copytree(NETS, tmp_path / "nets", ignore=shutil.ignore_patterns("*.net.xml"))
    subprocess.run([tmp_path / "nets" / "build.sh"], env=os.environ | {"PATH": path}, check=True, capture_output=True)
    assert {net.name: net.read_bytes() for net in (tmp_path / "nets").glob("*/*.net.xml")} == committed
    assert set(committed) == {"low.net.xml", "mixed.net.xml", "dense.net.xml"}


def test_bodies_are_as_large_as_scenes_take_them_to_be() -> None:
    sizes: dict[bool, set[tuple[float, float]]] = {False: set(), True: set()}  # by whether it is a truck
    for each in ElementTree.parse(NETS / "vtypes.add.xml").getroot():
        sizes["truck" in each.attrib["id"]].add((float(each.attrib["length"]), float(each.attrib["width"])))
    assert sizes == {False: {(CAR_LENGTH_M, CAR_WIDTH_M)}, True: {(TRUCK_LENGTH_M, TRUCK_WIDTH_M)}}
