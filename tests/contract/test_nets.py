import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import sumo_nets

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
