import math

import pytest

from risk_sac.records import Severity
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.judge import judge
from risk_sac.verdicts.severity import fatality_risk, serious_injury_risk, severity
from tests.unit.verdicts.staged import (
    WALKING,
    crossing_car,
    leader_brakes,
    mirrored,
    pedestrian_crosses,
    stage,
    straight,
)

MPH = 0.44704  # m/s


def test_a_pedestrian_dies_as_often_as_was_published() -> None:
    at = {kmh: fatality_risk(kmh / 3.6) for kmh in (0, 30, 40, 50, 76.7, 100)}
    assert at[50] > 2 * at[40]
    assert at[50] > 5 * at[30]
    assert at[50] == pytest.approx(0.083, abs=0.001)
    assert at[76.7] == pytest.approx(0.5, abs=0.001)
    assert at[0] < 0.0011


def test_an_occupant_is_seriously_injured_as_often_as_was_published() -> None:
    assert serious_injury_risk(6.9540 / 0.1637 * MPH) == pytest.approx(0.5)
    assert serious_injury_risk(30 * MPH) == pytest.approx(0.115, abs=0.001)
    assert serious_injury_risk(0.0) < 0.001


@pytest.mark.parametrize(
    ("closing_mps", "risk", "pedestrian", "expected"),
    [
        (1.99, 0.001, False, Severity.MINOR),
        (2.0, 0.001, False, Severity.MODERATE),
        (0.0, 0.001, True, Severity.MODERATE),
        (12.0, 0.0099, False, Severity.MODERATE),
        (12.0, 0.01, False, Severity.SEVERE),
        (12.0, 0.01, True, Severity.SEVERE),
    ],
)
def test_classes_at_their_edges(closing_mps: float, risk: float, pedestrian: bool, expected: Severity) -> None:
    assert severity(closing_mps, risk, pedestrian=pedestrian) is expected


def follows(closing_mps: float) -> Evidence:
    return stage(straight(0.0, 0.0, 0.0, 10.0 + closing_mps), straight(10.0, 0.0, 0.0, 10.0))


def stands_in_the_way(speed: float) -> Evidence:
    """A pedestrian that stands in the ego's way."""
    walker = straight(8.0, 0.2, math.pi / 2, 0.0)
    return stage(straight(0.0, 0.0, 0.0, speed), walker, kinds=WALKING)


@pytest.mark.parametrize(
    ("evidence", "expected"),
    [
        (follows(1.5), Severity.MINOR),
        (follows(3.0), Severity.MODERATE),
        (leader_brakes(), Severity.SEVERE),
        (crossing_car(), Severity.SEVERE),  # 17 m/s
        (crossing_car(ego=6.0, other=6.0), Severity.MODERATE),
        (pedestrian_crosses(), Severity.SEVERE),
        (stands_in_the_way(6.0), Severity.MODERATE),
        (stands_in_the_way(1.0), Severity.MODERATE),
    ],
)
def test_a_contact_says_how_bad_it_is(evidence: Evidence, expected: Severity) -> None:
    found, again = (judge(each, "actor_1", valid=True) for each in (evidence, mirrored(evidence)))
    assert (found.severity, found.injury_risk) == (again.severity, again.injury_risk)
    assert found.severity is expected
    assert found.injury_risk is not None
