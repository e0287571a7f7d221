"""The record of a requirement that counts and was violated without contact."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from risk_sac.config import Requirement
from risk_sac.records import NO_CONTACT, RequirementResult, Violation
from risk_sac.risk.measures import Measures
from risk_sac.risk.publish import ENCOUNTER
from risk_sac.risk.ttc import ENCOUNTER_CAP_S
from risk_sac.types import STEP_S, Frame, Kind, Role
from risk_sac.verdicts.definitions import DEFINITIONS
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.labels import MANOEUVRES, manoeuvre

# Of `ARTEFACT_RULES`, those that are about more than a contact.
RULES = ("no_teleport", "inside_limits")


def requirement_results(
    requirements: Sequence[Requirement], time_s: Sequence[float], measures: Sequence[Measures], contact_s: float | None
) -> dict[str, RequirementResult]:
    """How far each requirement was kept in an episode.

    Args:
      requirements: `M`.
      time_s: `T`, from the adversaries' release on.
      measures: of these frames.
      contact_s: when the bodies touched.
    """
    robustness = np.array([m.robustness for m in measures])
    first = (robustness < 0.0).argmax(axis=0)
    results = {}
    for i, (requirement, least) in enumerate(zip(requirements, robustness.min(axis=0).tolist(), strict=True)):
        violated_s = time_s[first[i]] if least < 0.0 else None
        if requirement.name == NO_CONTACT:  # at a contact its robustness is 0
            violated_s = contact_s
        results[requirement.name] = RequirementResult(
            counts=requirement.counts, robustness=least, violated_s=violated_s
        )
    return results


def violations_of(
    results: Mapping[str, RequirementResult],
    frames: Sequence[Frame],
    measures: Sequence[Measures],
    evidence: Evidence,
    artefacts: Mapping[str, float],
) -> tuple[Violation, ...]:
    """The violations without contact of the requirements that count, in the order of time.

    Args:
      results: how far each requirement was kept.
      frames: `T`, of the whole episode.
      measures: of these frames.
      evidence: of these frames.
      artefacts: rules of `ARTEFACT_RULES` that the episode broke, and when it first did, s of the simulator.
    """
    violated = {
        name: (each, each.violated_s)
        for name, each in results.items()
        if name != NO_CONTACT and each.counts == "failure" and each.violated_s is not None
    }
    released = int(np.searchsorted(evidence.time_s, -STEP_S / 2))
    found = []
    for name, (result, time_s) in violated.items():
        index = released + round(time_s / STEP_S)
        verdicts = {rule: artefacts.get(rule, math.inf) > frames[index].time_s for rule in RULES}
        found.append(
            _violation(name, time_s, result.robustness, frames[index], measures[index], evidence.until(index), verdicts)
        )
    return tuple(sorted(found, key=lambda violation: violation.time_s))


def _violation(
    requirement: str,
    time_s: float,
    robustness: float,
    frame: Frame,
    measures: Measures,
    evidence: Evidence,
    verdicts: Mapping[str, bool],
) -> Violation:
    """The record of a violation that began in `frame`, with which the evidence ends."""
    nearest = _soonest_met(measures)
    driven = manoeuvre(evidence)
    hidden = nearest is not None and not measures.assessment.seen[nearest - 1]
    return Violation(
        requirement=requirement,
        time_s=time_s,
        robustness=robustness,
        other_id=None if nearest is None else frame.ids[nearest],
        other_kind=None if nearest is None else Kind(int(frame.kind[nearest])).name.lower(),
        other_role=None if nearest is None else Role(int(frame.role[nearest])).name.lower(),
        ego_speed_mps=frame.ego_speed_mps,
        ego_manoeuvre=driven,
        hidden=hidden,
        broke=(),
        verdicts=verdicts,
        grade=None,
        drivers={},
        signature=_signature(requirement, driven, None if nearest is None else frame.kind[nearest], hidden),
        definitions=DEFINITIONS,
    )


def _soonest_met(measures: Measures) -> int | None:
    """The column in the frame of the actor that the ego would meet soonest; None if it would meet none."""
    encounter_s = measures.assessment.others[ENCOUNTER]
    nearest = int(encounter_s.argmin())
    return nearest + 1 if encounter_s[nearest] < ENCOUNTER_CAP_S else None


def _signature(requirement: str, driven: str, kind: int | None, hidden: bool) -> str:
    actor = "nobody near" if kind is None else f"{Kind(int(kind)).name.lower()} near{', hidden' if hidden else ''}"
    return f"{requirement} violated; {MANOEUVRES[driven]}, {actor}"
