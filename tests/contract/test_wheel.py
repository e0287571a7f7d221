import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("risk_sac", "service", "sumo_nets")
FAMILIES = ("low", "mixed", "dense")
MADE = ("node_modules", "dist")  # beside the page's sources, by an installation


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Names in a wheel built from a copy: building in the tree would leave files there."""
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


@pytest.mark.parametrize("family", FAMILIES)
def test_wheel_contains_the_net_and_its_sources(contents: set[str], family: str) -> None:
    assert {f"sumo_nets/{family}/{family}.{part}.xml" for part in ("net", "nod", "edg")} <= contents


def test_wheel_contains_actor_types_readme_and_type_markers(contents: set[str]) -> None:
    assert {"sumo_nets/vtypes.add.xml", "sumo_nets/README.md", "risk_sac/py.typed", "service/py.typed"} <= contents


def test_wheel_contains_the_page_which_it_has_built(contents: set[str]) -> None:
    assert "service/web/dist/index.html" in contents
    assets = [Path(name).suffix for name in contents if name.startswith("service/web/dist/assets/")]
    assert {".js", ".css"} <= set(assets)


def test_wheel_contains_every_module(contents: set[str]) -> None:
    modules = {
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if path.parent != ROOT / "service" / "web"  # what builds the page is no part of it
        and "node_modules" not in path.parts
    }
    assert modules <= contents


def test_wheel_contains_no_tests(contents: set[str]) -> None:
    assert not [name for name in contents if name.startswith("tests")]
