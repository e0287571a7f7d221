"""Contact with each body of the table: harm, severity and name."""

from dataclasses import replace

import numpy as np
import pytest

from risk_sac.scenario.bodies import BODIES, CODES
from risk_sac.verdicts.judge import judge
from risk_sac.world.types import Role
from tests.unit.verdicts.staged import cut_in, leader_brakes, mirrored, pedestrian_crosses

HARM = {"pedestrian": "death", "cyclist": "death", "motorcyclist": "serious injury", "occupant": "serious injury"}


@pytest.mark.parametrize("name", list(BODIES))
@pytest.mark.parametrize("staged", [cut_in, leader_brakes, pedestrian_crosses])
def test_the_row_decides_harm_and_name_on_either_side(name, staged):
    evidence = staged()
    evidence = replace(evidence, body=np.array([CODES["car"], CODES[name]], dtype=np.int8))
    judged, again = judge(evidence, "actor_1", valid=True), judge(mirrored(evidence), "actor_1", valid=True)
    assert judged.harm == HARM[BODIES[name].injury]
    assert (judged.severity, judged.injury_risk) == (again.severity, again.injury_risk)
    assert 0.0 < judged.injury_risk < 1.0
    assert name in judged.kind or BODIES[name].shape == "vehicle"


def test_riders_are_worse_off_than_occupants():
    risks = {}
    for name in ("car", "motorcycle", "bicycle"):
        evidence = replace(leader_brakes(), body=np.array([CODES["car"], CODES[name]], dtype=np.int8))
        risks[name] = judge(evidence, "actor_1", valid=True).injury_risk
    assert risks["car"] < min(risks["motorcycle"], risks["bicycle"])


def test_a_static_body_is_named_as_one_that_stands():
    evidence = replace(leader_brakes(), role=np.array([Role.EGO, Role.STATIC], dtype=np.int8))
    assert judge(evidence, "actor_1", valid=True).kind.startswith("standing vehicle")
