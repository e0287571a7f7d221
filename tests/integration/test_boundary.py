"""Boundary of an ego in a story: method, map, and refusals."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from risk_sac.config import Budget, CampaignSpec, EgoConfig, RunSpec
from risk_sac.config.campaign import BoundaryConfig
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.execution.evaluate import run
from risk_sac.records.rates import BoundaryMap
from risk_sac.run_folder.results import BOUNDARY, BOUNDARY_PICTURE
from risk_sac.scenario.library import VARIABLE, keep
from risk_sac.scenario.reading import document_from
from risk_sac.search.boundary_map import read_boundary
from tests.integration.test_sweep import CUT_IN

OVER = ("gap_m", "slower_mps")
EPISODES = 16


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, str(tmp_path_factory.mktemp("places")))
        yield keep(document_from(CUT_IN.replace("[6, 46]", "[2, 46]").replace("[5, 15]", "[5, 20]")), {})


def spec(family, **boundary):
    config = BoundaryConfig(**{"over": OVER} | boundary)
    budget, ego = Budget(episodes=EPISODES), EgoConfig(driver="broken")
    return RunSpec(family=family, method="boundary", seed=0, budget=budget, ego=ego, boundary=config)


@pytest.fixture(scope="module")
def folder(family, tmp_path_factory):
    folder = tmp_path_factory.mktemp("boundary")
    run(spec(family), folder, lambda done, metrics: None)
    return folder


def test_a_run_ends_with_a_map_that_its_records_give_again(folder: Path):
    found = BoundaryMap.model_validate_json((folder / BOUNDARY).read_bytes())
    assert found == read_boundary(folder, {})
    assert (folder / BOUNDARY_PICTURE).read_bytes().startswith(b"\x89PNG")
    assert len(found.points) == EPISODES
    assert [driver.name for driver in found.maps] == ["ego", "r157", "fsm"]
    assert set(found.fixed) == {"side"}
    size = len(found.axes[0].levels) * len(found.axes[1].levels)
    for driver in found.maps:
        assert len(driver.probability) == (size if driver.always is None else 0)
        assert driver.fails.low <= driver.fails.share <= driver.fails.high
    assert found.maps[1].ego_fails_alone is not None


def test_a_second_ego_stands_beside_the_first(folder: Path):
    found = read_boundary(folder, {"again": folder})
    again = found.maps[-1]
    assert (again.name, again.judged, again.episodes) == ("again", False, found.maps[0].episodes)
    assert again.probability == found.maps[0].probability
    assert again.ego_fails_alone is not None


@pytest.mark.parametrize(
    ("boundary", "field"),
    [
        ({"over": ("gap_m", "slower")}, "boundary.over"),
        ({"over": ("gap_m", "side")}, "boundary.over"),
        ({"at": {"sides": 0.2}}, "boundary.at"),
        ({"at": {"side": 2.0}}, "boundary.at.side"),
        ({"requirement": "politeness"}, "boundary.requirement"),
    ],
)
def test_what_has_no_boundary_is_refused(family, boundary, field):
    with pytest.raises(ConfigError) as refused:
        Problem.from_spec(spec(family, **boundary))
    assert refused.value.field == field


@pytest.mark.parametrize(
    "boundary",
    [{"over": ("a",)}, {"over": ("a", "b", "c", "d", "e")}, {"over": ("a", "a")}, {"over": OVER, "at": {"gap_m": 1.0}}],
)
def test_two_to_four_different_parameters_are_wanted(boundary):
    with pytest.raises(ValidationError):
        BoundaryConfig(**boundary)


@pytest.mark.parametrize("given", [{"methods": ("boundary",)}, {"boundary": BoundaryConfig(over=OVER)}])
def test_method_and_parameters_go_together(family, given):
    with pytest.raises(ValidationError):
        CampaignSpec(families=(family,), **given)
