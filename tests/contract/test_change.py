"""What `risk_sac/change.md` adds works, made in a copy of the code."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "risk_sac" / "change.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
STEP = re.compile(r"`([\w./]+)`(?:, (before|instead of) `([^`\n]+)`)?:\n\n```\w+\n(.*?)```", re.S)
USED = """
from pathlib import Path

from risk_sac.config import RunSpec
from risk_sac.egos.registry import cards
from risk_sac.env.problem import Problem
from risk_sac.failures.bundle import read_bundle
from risk_sac.failures.export.formats import FormatName, export
from risk_sac.failures.export.recorded import Recorded
from service.app import create_app
from service.settings import ServiceSettings

calm = {"name": "calm", "formula": "ego_accel_mps2 <= 4"}
spec = {"family": "child_runs_out", "method": "sac-shaped", "seed": 0, "ego": {"driver": "follower"}}
problem = Problem.from_spec(RunSpec.model_validate(spec | {"requirements": [calm]}))
space = problem.family.space
layout = problem.family.layout(space.from_unit([0.5] * space.dimension).values)
print("body", [actor.body for actor in layout.pedestrians])
print("signal", [each.name for each in problem.requirements if each.name == "calm"])
print("ego", "follower" in [card.name for card in cards()])
failure = Recorded.of(read_bundle(Path("low.npz")))
print("export", *[content.decode().splitlines()[0] for content in export(FormatName("csv"), failure).values()])
print("route", "/v1/bodies" in create_app(ServiceSettings()).openapi()["paths"])
"""


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("changed")
    for folder in ("risk_sac", "service", "sumo_nets"):
        unwanted = shutil.ignore_patterns("node_modules", "dist", "__pycache__", "*.md", "*.png", "pictures")
        shutil.copytree(ROOT / folder, copy / folder, ignore=unwanted)
    shutil.copy(ROOT / "tests" / "exports" / "examples" / "low.npz", copy)
    for name, where, anchor, block in STEP.findall(PAGE):
        file = copy / name
        if not where:
            assert not file.exists(), name
            file.parent.mkdir(exist_ok=True)
            file.write_text(block, encoding="utf-8")
            continue
        text = file.read_text(encoding="utf-8")
        assert text.count(anchor) == 1, (name, anchor)
        file.write_text(text.replace(anchor, block + anchor if where == "before" else block.strip()), encoding="utf-8")
    (document,) = re.findall(r"^```yaml\n(.*?)^```", README, re.M | re.S)
    folder = copy / "sumo_nets" / "child_runs_out"
    folder.mkdir()
    (folder / "child_runs_out.yaml").write_text(document.replace("body: child", "body: scooter"), encoding="utf-8")
    return copy


def test_each_addition_is_used_by_the_code(changed: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(changed)}
    used = subprocess.run([sys.executable, "-c", USED], cwd=changed, env=environment, capture_output=True, text=True)
    assert used.returncode == 0, used.stderr[-4000:]
    told = dict(line.split(" ", 1) for line in used.stdout.splitlines())
    assert told == {
        "body": "['scooter']",
        "signal": "['calm']",
        "ego": "True",
        "export": "time_s,speed_mps",
        "route": "True",
    }


def test_every_file_that_the_page_names_is_there() -> None:
    named = set(re.findall(r"`((?:risk_sac|service|sumo_nets|tests)/[a-z/_.]+)`", PAGE))
    added = {name for name, where, *_ in STEP.findall(PAGE) if not where}
    assert len(named) > 12
    assert [name for name in named - added if not (ROOT / name).exists()] == []
