"""Recorded contacts by name, judged as an ADS engineer judges them; see `tests.unit.verdicts.recorded`."""

from dataclasses import replace
from typing import NamedTuple

import pytest

from risk_sac.records import Grade, Judgement, Severity
from risk_sac.verdicts.judge import judge
from tests.unit.verdicts.recorded import recorded
from tests.unit.verdicts.staged import mirrored


class Expected(NamedTuple):
    """What an engineer says of a contact."""

    grade: Grade
    response: str
    severity: Severity


NAMED = {
    # It passes a pedestrian on red that stands 0.5 m beside its way and speeds up, then brakes for 0.4 s.
    "dense_267": Expected(Grade.PREVENTABLE, "braking", Severity.MODERATE),
    # It stops in its turn, sees the crossing car for 7.7 s, and starts into it.
    "dense_263": Expected(Grade.PREVENTABLE, "starting", Severity.MODERATE),
    # It passes a vehicle that stops at an unsignalled crossing, at 14 m/s; a pedestrian comes from behind that vehicle.
    "mixed_71": Expected(Grade.PREVENTABLE, "braking", Severity.MODERATE),
    # Two vehicles side by side creep at 2 m/s, and their flanks touch.
    "mixed_294": Expected(Grade.FULL_BRAKING, "braking", Severity.MINOR),
    # A vehicle that overtakes comes over from alongside, twice; the ego rolls on, or brakes late.
    "low_267": Expected(Grade.PREVENTABLE, "none", Severity.MODERATE),
    "low_198": Expected(Grade.PREVENTABLE, "late_braking", Severity.MODERATE),
}


def verdict(name: str) -> Judgement:
    evidence, striker = recorded(name)
    return judge(evidence, striker, valid=True)


@pytest.mark.parametrize("name", NAMED)
def test_what_an_engineer_says(name: str) -> None:
    found, expected = verdict(name), NAMED[name]
    assert (found.grade, found.ego_response, found.severity) == expected


@pytest.mark.parametrize("name", NAMED)
def test_the_mirrored_contact_has_the_same_verdict(name: str) -> None:
    evidence, striker = recorded(name)
    evidence = replace(evidence, ground=replace(evidence.ground, net=""))  # there is no mirrored net
    first, second = (judge(each, striker, valid=True) for each in (evidence, mirrored(evidence)))
    assert (second.grade, second.severity, second.ego_response) == (first.grade, first.severity, first.ego_response)
