"""Every shipped document is short, described, and poses playable scenes."""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from risk_sac.config import RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.reading import scenario_file, shipped_document, shipped_names

MOST_LINES = 40
TAGS = ("iso34502:", "ncap:", "un-r157:")
each_document = pytest.mark.parametrize("name", shipped_names())


def layouts(name: str, count: int, seed: int = 3) -> list[Layout]:
    """Layouts of the first scenes that no constraint refuses."""
    family, random = FAMILIES[name], np.random.default_rng(seed)
    possible = list[Layout]()
    for _ in range(10 * count):
        try:
            possible.append(family.layout(family.space.from_unit(random.random(family.space.dimension)).values))
        except InfeasibleScene:
            continue
    return possible[:count]


def test_fourteen_or_more_ship() -> None:
    assert len(shipped_names()) >= 14


def test_every_document_has_a_folder_of_its_name() -> None:
    written = {path.stem for path in Path(str(files("sumo_nets"))).glob("*/*.yaml")}
    assert written == set(shipped_names())


@each_document
def test_documents_are_short_and_described(name: str) -> None:
    document = shipped_document(name)
    assert document.name == name
    assert len(scenario_file(name).read_text().splitlines()) <= MOST_LINES
    assert document.summary
    assert any(tag.startswith(TAGS) for tag in document.tags)
    assert all(parameter.meaning for parameter in document.parameters.values())


@each_document
def test_scenes_differ_and_keep_actors_apart(name: str) -> None:
    several = layouts(name, 5)
    assert len({repr(layout) for layout in several}) == 5
    for layout in several:
        starts = {(start.route[0], start.lane, round(start.position_m, 1)) for start in (layout.ego, *layout.vehicles)}
        assert len(starts) == 1 + len(layout.vehicles)


@each_document
def test_a_scene_plays(name: str) -> None:
    env = RiskSacEnv.of(RunSpec(family=name, method="random", seed=0))
    try:
        env.reset(seed=5)
        for _ in range(20):
            *_, terminated, _, _ = env.step(np.zeros(env.action_size, dtype=np.float32))
            assert not terminated
        assert env.trace.frames[-1].ego_speed_mps >= 0.0
    finally:
        env.close()


def test_a_scene_without_some_of_its_adversaries_plays() -> None:
    family = FAMILIES["motorway_traffic"]
    env = RiskSacEnv.of(RunSpec(family="motorway_traffic", method="random", seed=0))
    middle = dict.fromkeys(family.space.names, 0.5)
    try:
        for share, there in ((0.1, {"lead"}), (0.4, {"lead", "left"}), (0.9, {"lead", "left", "right", "far_left"})):
            unit = np.array(list((middle | {"vehicles": share}).values()))
            env.reset(seed=1, options={"scene": family.space.from_unit(unit)})
            env.step(np.zeros(env.action_size, dtype=np.float32))
            assert there == set(family.vehicles) & set(env.trace.frames[-1].ids)
    finally:
        env.close()


def test_speeds_of_the_whole_way_belong_to_the_odd() -> None:
    odd = FAMILIES["ramp_merge_ego"].odd  # it begins on a ramp of 22.22 m/s and merges onto a motorway of 36 m/s
    assert odd.scenery.speed_limit_mps is not None
    assert (odd.scenery.speed_limit_mps.low, odd.scenery.speed_limit_mps.high) == (22.22, 36.0)
