"""Contents of the wheel, modules that the server loads, and rebuilt nets."""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

import sumo_nets
from risk_sac.scenario.layout import CAR_LENGTH_M, CAR_WIDTH_M, TRUCK_LENGTH_M, TRUCK_WIDTH_M

ROOT = Path(__file__).parents[2]
PACKAGES = ("risk_sac", "service", "sumo_nets")
FAMILIES = ("low", "mixed", "dense")
MADE = ("node_modules", "dist")  # beside the page's sources, by an installation


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Returns the names in a wheel, built from the tree's copy."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, source / package, ignore=shutil.ignore_patterns("__pycache__", *MADE))
    for file in ("pyproject.toml", "openapi.yaml"):
        shutil.copy(ROOT / file, source)
    command = [sys.executable, "-m", "pip", "wheel", str(source), "--wheel-dir", str(out)]
    offline = ["--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check", "--quiet"]
    built = subprocess.run([*command, *offline], capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    (wheel,) = out.glob("risk_sac-*.whl")
    return set(zipfile.ZipFile(wheel).namelist())


def test_wheel_contains_nets_and_page_and_no_tests(contents):
    assert {f"sumo_nets/{name}/{name}.{part}.xml" for name in FAMILIES for part in ("net", "nod", "edg")} <= contents
    assert {"sumo_nets/vtypes.add.xml", "sumo_nets/README.md", "risk_sac/py.typed", "service/py.typed"} <= contents
    assert "service/web/dist/index.html" in contents
    assets = [Path(name).suffix for name in contents if name.startswith("service/web/dist/assets/")]
    assert {".js", ".css"} <= set(assets)
    assert not [name for name in contents if name.startswith("tests")]


def test_wheel_contains_every_module(contents):
    modules = {
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if path.parent != ROOT / "service" / "web"  # what builds the page is no part of it
        and "node_modules" not in path.parts
    }
    assert modules <= contents


@pytest.fixture(scope="module")
def loaded() -> set[str]:
    """Names of its modules."""
    code = (
        "import json, sys; from service.app import create_app; from service.settings import ServiceSettings;"
        "create_app(ServiceSettings()).openapi(); print(json.dumps(sorted(sys.modules)))"
    )
    return set(json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout))


def test_the_server_process_loads_nothing_that_learns_compiles_or_simulates_and_matplotlib_to_draw(loaded):
    assert "service.runs.manager" in loaded
    assert "risk_sac.report" in loaded
    assert not {"torch", "libsumo", "botorch", "gpytorch", "numba", "matplotlib", "risk_sac.execution.worker"} & loaded


def test_the_server_loads_nothing_of_a_cluster_that_it_does_not_use(loaded):
    assert "risk_sac.execution.executor" in loaded
    assert not {"ray", "risk_sac.execution.ray.executor", "risk_sac.execution.ray.bridge"} & loaded


def test_the_server_reads_no_upload_itself(loaded):
    assert "service.networks.network_store" in loaded
    assert not [name for name in loaded if name.startswith("service.networks.checker")]


NETS = Path(sumo_nets.__path__[0])


def test_rebuilding_the_nets_gives_the_same_bytes(tmp_path):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    if shutil.which("netconvert", path=path) is None:
        pytest.skip("netconvert is not installed")
    committed = {net.name: net.read_bytes() for net in NETS.glob("*/*.net.xml")}
    shutil.copytree(NETS, tmp_path / "nets", ignore=shutil.ignore_patterns("*.net.xml"))
    subprocess.run([tmp_path / "nets" / "build.sh"], env=os.environ | {"PATH": path}, check=True, capture_output=True)
    assert {net.name: net.read_bytes() for net in (tmp_path / "nets").glob("*/*.net.xml")} == committed
    assert {"low.net.xml", "mixed.net.xml", "dense.net.xml", "motorway_ramp.net.xml"} <= set(committed)


def test_bodies_are_as_large_as_scenes_take_them_to_be():
    sizes: dict[bool, set[tuple[float, float]]] = {False: set(), True: set()}  # by whether it is a truck
    for each in ElementTree.parse(NETS / "vtypes.add.xml").getroot():
        sizes["truck" in each.attrib["id"]].add((float(each.attrib["length"]), float(each.attrib["width"])))
    assert sizes == {False: {(CAR_LENGTH_M, CAR_WIDTH_M)}, True: {(TRUCK_LENGTH_M, TRUCK_WIDTH_M)}}
