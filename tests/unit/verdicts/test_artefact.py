from dataclasses import replace

import pytest

from risk_sac.records import ARTEFACT_RULES, REPEATS
from risk_sac.verdicts.artefact import Handling, artefact_verdicts
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.evidence import Evidence
from tests.unit.verdicts.staged import cut_in, hangs_over, leader_brakes

CLEAN = Handling(teleported=False, spawn_overlap=False, inside_limits=True, touched_before=False, ego_model_saw=True)


def broken(evidence: Evidence, handling: Handling = CLEAN) -> set[str]:
    found = artefact_verdicts(evidence, 1, find_conflict(evidence, 1), handling)
    assert set(found) == ARTEFACT_RULES - {REPEATS}
    return {rule for rule, passed in found.items() if not passed}


def test_a_clean_contact_passes() -> None:
    assert broken(cut_in()) == set()


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"teleported": True}, "no_teleport"),
        ({"spawn_overlap": True}, "no_spawn_overlap"),
        ({"inside_limits": False}, "inside_limits"),
        ({"touched_before": True}, "solid_bodies"),
        ({"ego_model_saw": False}, "ego_model_saw"),
    ],
)
def test_each_fact_breaks_its_own_rule(change: dict[str, bool], rule: str) -> None:
    assert broken(cut_in(), replace(CLEAN, **change)) == {rule}


def test_a_striker_that_the_road_cannot_hold_breaks_inside_grip() -> None:
    braking = leader_brakes(braking=8.0)
    assert broken(replace(braking, ground=replace(braking.ground, friction=0.6))) == {"inside_grip"}


@pytest.mark.parametrize(("at_s", "rules"), [(0.5, {"conflict_after_release"}), (0.7, set()), (2.0, set())])
def test_a_conflict_of_the_first_second_was_inherited(at_s: float, rules: set[str]) -> None:
    assert broken(cut_in(gap=8.0, at_s=at_s)) == rules  # 0.3125 s later it is 0.375 m over


@pytest.mark.parametrize(("at_s", "rules"), [(0.5, {"conflict_after_release"}), (0.8, set())])
def test_who_hung_over_in_the_first_second_was_inherited_whenever_it_comes(at_s: float, rules: set[str]) -> None:
    assert broken(hangs_over(at_s=at_s, comes_at_s=2.5)) == rules
