import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

import sumo_nets
from risk_sac.scenario.layout import CAR_LENGTH_M, CAR_WIDTH_M, TRUCK_LENGTH_M

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


def test_bodies_are_as_long_as_scenes_take_them_to_be() -> None:
    types = ElementTree.parse(NETS / "vtypes.add.xml").getroot()
    cars = {(each.get("length"), each.get("width")) for each in types if "truck" not in each.get("id", "")}
    trucks = {each.get("length") for each in types if "truck" in each.get("id", "")}
    assert {(float(length or 0), float(width or 0)) for length, width in cars} == {(CAR_LENGTH_M, CAR_WIDTH_M)}
    assert {float(length or 0) for length in trucks} == {TRUCK_LENGTH_M}
