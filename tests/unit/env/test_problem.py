"""What is used otherwise than it was asked for is said."""

from contextlib import closing

import pytest

from risk_sac.config import (
    CampaignSpec,
    EgoConfig,
    Odd,
    Requirement,
    RunSpec,
)
from risk_sac.env.problem import Problem, adjustments, checked_campaign
from risk_sac.errors import ConfigError, FormulaError, OddError
from risk_sac.failures.trials import ALIKE_M, LEFT, MET_M, RIGHT, meet
from risk_sac.sim.sumo import SumoSimulation


def problem(family: str = "mixed", **settings: object) -> Problem:
    return Problem.from_spec(RunSpec(family=family, method="risk-sac", seed=0, **settings))


def wanted_ttc_s(posed: Problem) -> float:
    (safe,) = (each for each in posed.requirements if each.name == "safe_ttc")
    return float(safe.formula.rpartition(" ")[2])


@pytest.mark.parametrize(
    ("family", "part", "field", "value"),
    [
        ("dense", "scenery", "signal_types", ("none",)),
        ("mixed", "scenery", "crossing_types", ("none",)),
        ("mixed", "dynamic", "actor_kinds", ("vehicle",)),
        ("low", "scenery", "lanes", {"low": 1, "high": 2}),
        ("low", "scenery", "speed_limit_mps", {"low": 20, "high": 30}),
        ("low", "environment", "time_of_day", ("night",)),
        ("low", "dynamic", "ego_speed_mps", {"low": 0, "high": 5}),
    ],
)
def test_an_odd_that_leaves_no_scene_is_an_error_that_names_its_field(family, part, field, value):
    with pytest.raises(OddError) as refused:
        problem(family, odd=Odd.model_validate({part: {field: value}}))
    assert refused.value.field == f"odd.{part}.{field}"


def test_an_episode_goes_on_to_the_horizon_where_more_than_a_contact_can_make_it_fail():
    assert problem("dense").contact_alone_counts
    assert not problem("dense", ego=EgoConfig(driver="idm-aeb")).contact_alone_counts
    assert not problem("dense", requirements=(Requirement(name="safe_ttc"),)).contact_alone_counts
    mine = Requirement(name="slow", formula="ego_speed_mps <= 5", counts="report")
    assert problem("dense", requirements=(mine,)).contact_alone_counts


def test_a_bad_formula_anywhere_in_a_campaign_is_found_before_it_runs():
    spec = CampaignSpec(
        families=("low", "mixed"), requirements=(Requirement(name="soon", formula="eventually(ttc_s > 1)", scale=1),)
    )
    with pytest.raises(FormulaError) as refused:
        checked_campaign(spec)
    assert refused.value.field == "requirements[0].formula"
    assert refused.value.position == 0


def test_rss_asks_the_same_of_any_ego_and_time_to_collision_the_more_the_slower_it_says_it_is():
    """RSS refuses scenes; by an ego's time, slow ones get milder scenes."""
    egos = [EgoConfig(reaction_time_s=t) for t in (0.1, 0.5, 1.0)]
    egos += [EgoConfig(driver=name) for name in ("rss", "idm-aeb", "broken", "r157")]
    egos += [EgoConfig(driver="rss", response_time_s=t) for t in (0.0, 5.0)]
    posed = sorted((problem(ego=ego) for ego in egos), key=lambda posed: posed.ego.response_s)
    assert {each.rss for each in posed} == {problem().rss}
    assert problem().rss.response_s == 0.5
    wanted_s = [wanted_ttc_s(each) for each in posed]
    assert wanted_s == sorted(wanted_s)
    assert wanted_s[0] == wanted_ttc_s(problem()) == 1.5  # claiming a shorter response time gives no advantage
    assert wanted_s[-1] == 6.0


def test_a_method_whose_package_is_not_installed_is_refused_before_it_runs(monkeypatch):
    campaign = CampaignSpec(families=("low",), methods=("random", "sb3-sac"))
    checked_campaign(campaign)
    monkeypatch.setattr("risk_sac.env.problem.find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"'sb3-sac', which needs stable_baselines3; pip install") as refusal:
        checked_campaign(campaign)
    assert refusal.value.field == "methods"


@pytest.fixture(scope="module")
def sim():
    with closing(SumoSimulation(EgoConfig())) as simulation:
        yield simulation


@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_the_ego_meets_a_pedestrian_on_its_way_and_touches_none_from_either_side(sim, family):
    left_m, right_m = (meet(sim, family, side) for side in (LEFT, RIGHT))
    assert 0.0 < min(left_m, right_m) < MET_M
    assert abs(left_m - right_m) <= ALIKE_M


def said(families: tuple[str, ...] = ("low", "mixed", "dense"), ego: object = None, **odd: object) -> list[str]:
    return [str(each) for each in adjustments(CampaignSpec(families=families, odd=odd, ego=ego or {}))]


def test_nothing_is_said_of_an_odd_that_is_used_as_it_is():
    assert said() == []
    assert said(environment={"friction": {"low": 0.6, "high": 0.7}}) == []
    assert said(("mixed",), environment={"time_of_day": ["day", "night"], "precipitation": ["rain"]}) == []


@pytest.mark.parametrize(
    ("family", "part", "asked", "used"),
    [
        ("mixed", "environment", {"friction": {"low": 0.2, "high": 0.9}}, "used [0.4, 0.9] in mixed"),
        ("low", "environment", {"time_of_day": ["day", "night"]}, "used {day} in low"),
        ("mixed", "dynamic", {"pedestrian_speed_mps": {"low": 0, "high": 3}}, "used [0, 2] in mixed"),
    ],
)
def test_what_is_clipped_is_said(family, part, asked, used):
    (words,) = said((family,), **{part: asked})
    assert used in words
    assert words.startswith(f"odd.{part}.{next(iter(asked))}: ")


def test_a_shipped_requirement_that_a_family_lacks_is_said_and_counts_where_there_is_one():
    spec = CampaignSpec(families=("low", "mixed"), requirements=(Requirement(name="pedestrian_gap"),))
    checked_campaign(spec)
    (adjustment,) = adjustments(spec)
    assert (adjustment.families, adjustment.field, adjustment.used) == (("low",), "requirements[0]", "nothing")
    assert "pedestrian_gap" in adjustment.why
