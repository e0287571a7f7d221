"""The record of a contact and its judgement, from its evidence alone."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np

from risk_sac.config import Requirement
from risk_sac.records import NO_CONTACT, Collision, ConflictType, Fault, Grade, Judgement, RequirementResult, Violation
from risk_sac.risk.measures import Gauge, Measures
from risk_sac.risk.publish import ENCOUNTER, worst_rss_margin
from risk_sac.risk.rss import ENCOUNTER_CAP_S, TTC_CAP_S
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.scenario.bodies import body_of
from risk_sac.sim.collision import Contact
from risk_sac.verdicts.conflict import Conflict, find_conflict, unresponsive
from risk_sac.verdicts.evidence import Evidence, recorded_contact
from risk_sac.verdicts.fault import came_first, ego_part, fault, has_to_yield, parts_of_contact, parts_of_violation
from risk_sac.verdicts.labels import ground, impact, manoeuvre, name_contact, name_violation, response, severity
from risk_sac.verdicts.offences import ego_offences, endangered_ego, inherits_stop, striker_offences
from risk_sac.verdicts.plausibility import plausibility_of
from risk_sac.verdicts.reference import (
    NO_RED_LIGHT_ENTRY,
    PREVENTING,
    History,
    MetActor,
    grade,
    kept_by,
    reference_outcomes,
)
from risk_sac.verdicts.validity import (
    AFTER_RELEASE_S,
    EpisodeFacts,
    artefact_verdicts,
    begins_after_release,
    overlaps_before_contact,
    validity_verdicts,
)
from risk_sac.world.types import STEP_S, Frame, Kind, Role, Signal

DEFINITIONS = 11  # raise it with whatever changes a verdict; what was judged before says by which it was

WARNING_STEPS = round(1.0 / STEP_S)  # what a failure is remembered by ends this long before the contact


def collision_of(
    contact: Contact,
    frame: Frame,
    released_s: float,
    evidence: Evidence,
    measures: Sequence[Measures],
    facts: EpisodeFacts,
    *,
    drivers: Collection[str] = PREVENTING,
) -> Collision:
    """Returns the record of a contact in `frame`, the last one.

    `measures` begin with the release at `released_s`.
    `drivers` are the reference drivers whose word makes it preventable.
    """
    other, warning = frame.ids[contact.other], measures[:-WARNING_STEPS]
    column = evidence.column(other)
    conflict = find_conflict(evidence, column)
    verdicts = {
        **artefact_verdicts(evidence, column, conflict, facts),
        **validity_verdicts(evidence, column, contact, facts),
    }
    return Collision(
        time_s=contact.time_s - released_s,
        other_id=other,
        other_kind=Kind(int(frame.kind[contact.other])).name.lower(),
        other_body=body_of(int(frame.body[contact.other])).name,
        other_role=Role(int(frame.role[contact.other])).name.lower(),
        contact_x_m=contact.x_m,
        contact_y_m=contact.y_m,
        ego_zone=contact.ego_zone,
        other_zone=contact.other_zone,
        ego_speed_mps=frame.ego_speed_mps,
        other_speed_mps=float(frame.speed_mps[contact.other]),
        relative_speed_mps=contact.relative_speed_mps,
        lateral_offset_m=contact.lateral_offset_m,
        early_min_ttc_s=min((m.signals["ttc_s"] for m in warning), default=TTC_CAP_S),
        min_rss_margin_m=min(worst_rss_margin(m.assessment) for m in measures),
        visible_for_s=facts.visible_for_s,
        ego_peak_braking_mps2=max(m.signals["ego_braking_mps2"] for m in measures),
        early_min_robustness=min((m.soft_min for m in warning), default=ROBUSTNESS_CLIP),
        simulator_agrees=facts.simulator_agrees,
        verdicts=verdicts,
        judgement=judge(
            evidence, other, valid=all(verdicts.values()), conflict=conflict, contact=contact, preventing=drivers
        ),
    )


def judge(
    evidence: Evidence,
    striker_id: str,
    *,
    valid: bool,
    conflict: Conflict | None = None,
    preventing: Collection[str] = PREVENTING,
    contact: Contact | None = None,
) -> Judgement:
    """Judges a contact: how it began, its fault, its severity, its grade.

    The contact is in the last frame. Only a valid one is graded, by the drivers that would have prevented it.

    A valid contact passed every rule of `artefact_verdicts` and `validity_verdicts`. Conflict and contact are found
    again if not given. `preventing` are the reference drivers whose word counts.

    Raises:
      ValueError: the striker is not there in the last frame.
    """
    striker = evidence.column(striker_id)
    conflict = conflict or find_conflict(evidence, striker)
    ego_manoeuvre, ego_response = manoeuvre(evidence), response(evidence, conflict)
    where, crossing = ground(evidence, striker), conflict.type is ConflictType.CROSSING
    broke = striker_offences(evidence, striker, crossing=crossing) + endangered_ego(evidence, striker, conflict)
    ego_broke = ego_offences(evidence, striker, crossing=crossing)
    drivers = reference_outcomes(evidence, striker, conflict) if valid else {}
    avoids = {name: each.avoids for name, each in drivers.items()}
    graded = grade(avoids, preventing) if valid else None
    yields = has_to_yield(conflict.type, where, broke, ego_broke, first=came_first(evidence, striker))
    part = ego_part(evidence, striker, conflict, yields)
    contact = contact or recorded_contact(evidence, striker)
    struck = impact(evidence, striker, contact)
    kind, variant = name_contact(
        evidence,
        striker,
        conflict,
        manoeuvre=ego_manoeuvre,
        response=ego_response,
        ground=where,
        broke=broke,
        ego_broke=ego_broke,
    )
    return Judgement(
        definitions=DEFINITIONS,
        conflict_type=conflict.type,
        conflict_s=conflict.time_s,
        noticed_s=conflict.noticed_s,
        conflict_x_m=conflict.x_m,
        conflict_y_m=conflict.y_m,
        position=conflict.position,
        hidden=conflict.hidden,
        ego_manoeuvre=ego_manoeuvre,
        ego_response=ego_response,
        ground=where,
        broke=broke,
        ego_broke=ego_broke,
        severity=severity(struck.speed_mps, struck.risk),
        impact_mps=struck.speed_mps,
        injury_risk=struck.risk,
        harm=struck.harm,
        unresponsive=unresponsive(evidence, conflict),
        grade=graded,
        drivers=drivers,
        ego_part=part if valid else None,
        fault=graded
        and fault(
            parts_of_contact(
                part,
                conflict.type,
                yields=yields,
                broke=broke,
                ego_broke=ego_broke,
                avoids=avoids,
                grade=graded,
                lasted_s=float(evidence.time_s[-1]) - conflict.time_s,
                contact_x_m=contact.x_m,
            )
        ),
        plausibility=plausibility_of(evidence) if valid else None,
        kind=kind,
        variant=variant,
    )


# Of `ARTEFACT_RULES`, those that the episode tells; `solid_bodies` is read from its record.
RULES = ("no_teleport", "inside_limits")
# Signals that others bring about too; all others are the ego's own driving.
OF_OTHERS = frozenset(
    {
        "ttc_s",
        "encounter_s",
        "rss_margin",
        "pedestrian_gap_m",
        "vehicle_gap_m",
        "headway_s",
        "ego_braking_mps2",
        "ego_jerk_mps3",
    }
)
INHERITED_S = 5.0  # Choice: a violation that the ego inherits and has not ended by then is its own
ONSETS = 4  # of one requirement that are judged


def requirement_results(
    requirements: Sequence[Requirement], time_s: Sequence[float], measures: Sequence[Measures], contact_s: float | None
) -> dict[str, RequirementResult]:
    """Finds how far each requirement was kept in an episode.

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
    requirements: Sequence[Requirement],
    results: Mapping[str, RequirementResult],
    gather: Callable[[], History],
    gauge: Gauge,
    artefacts: Mapping[str, float],
    *,
    drivers: Collection[str] = PREVENTING,
) -> tuple[Violation, ...]:
    """Returns violations without contact of the requirements that count, ordered by time.

    Args:
      requirements: of the episode.
      results: how far each requirement was kept.
      gather: returns the whole episode; it takes milliseconds, and is called if there is a violation.
      gauge: that measured it.
      artefacts: rules of `ARTEFACT_RULES` that the episode broke, and when it first did, s of the simulator.
      drivers: the reference drivers whose word makes a violation preventable.
    """
    counting = [each for each in requirements if each.name != NO_CONTACT and each.counts == "failure"]
    violated = [requirement for requirement in counting if results[requirement.name].violated_s is not None]
    if not violated:
        return ()
    history, violations = gather(), []
    overlap_s = min((overlap.time_s for overlap in overlaps_before_contact(history.evidence)), default=math.inf)
    for requirement in violated:
        result, frames = results[requirement.name], []
        for index in _onsets(history, requirements.index(requirement)):
            time_s = (index - history.evidence.released) * STEP_S
            verdicts = {rule: artefacts.get(rule, math.inf) > history.frames[index].time_s for rule in RULES}
            verdicts["solid_bodies"] = time_s < overlap_s
            frames.append(_violation(requirement, result, history, gauge, index, verdicts=verdicts, preventing=drivers))
            if frames[-1].valid:
                break
        violations.append(next((violation for violation in frames if violation.valid), frames[0]))
    return tuple(sorted(violations, key=lambda violation: violation.time_s))


def _onsets(history: History, column: int) -> list[int]:
    """Lists up to four frames in which a requirement becomes violated.

    One that has lasted since the first second begins once more after 5 s.
    """
    released = history.evidence.released
    violated = np.array([measures.robustness[column] < 0.0 for measures in history.measures])
    violated[:released] = False
    begins = violated & ~np.concatenate(([False], violated[:-1]))
    inherited, ended = (released + round(after_s / STEP_S) for after_s in (AFTER_RELEASE_S, INHERITED_S))
    if ended < len(violated) and violated[inherited - 1 : ended + 1].all():
        begins[ended] = True
    return [int(frame) for frame in np.flatnonzero(begins)[:ONSETS]]


def _violation(
    requirement: Requirement,
    result: RequirementResult,
    history: History,
    gauge: Gauge,
    index: int,
    *,
    verdicts: Mapping[str, bool],
    preventing: Collection[str],
) -> Violation:
    """The record of a violation that began in frame `index`."""
    frame, measures, evidence = history.frames[index], history.measures[index], history.evidence.until(index)
    own_gauge = gauge.of(requirement)
    nearest = _soonest_met(measures)
    met = None
    if nearest is not None:
        column = evidence.column(frame.ids[nearest])
        met = MetActor(column, find_conflict(evidence, column))
    by_others = met if OF_OTHERS.intersection(own_gauge.signals) else None
    time_s = float(evidence.time_s[-1])
    verdicts = {**verdicts, "conflict_after_release": not _inherited(requirement, history, time_s, by_others)}
    driven, broke = manoeuvre(evidence), ego_offences(evidence)
    if requirement.name == NO_RED_LIGHT_ENTRY:  # it may be violated before the line, when the ego cannot stop any more
        broke = tuple(dict.fromkeys(("red_light", *broke)))
    drivers = kept_by(requirement, own_gauge, history, index, met) if all(verdicts.values()) else {}
    graded = grade(drivers, preventing) if drivers else None
    kind, variant = name_violation(requirement.name, manoeuvre=driven, broke=broke, ego_mps=frame.ego_speed_mps)
    named = None if by_others is None else nearest
    return Violation(
        requirement=requirement.name,
        time_s=round(time_s, 6),
        robustness=result.robustness,
        other_id=None if named is None else frame.ids[named],
        other_kind=None if named is None else Kind(int(frame.kind[named])).name.lower(),
        other_body=None if named is None else body_of(int(frame.body[named])).name,
        other_role=None if named is None else Role(int(frame.role[named])).name.lower(),
        ego_speed_mps=frame.ego_speed_mps,
        ego_manoeuvre=driven,
        hidden=by_others is not None and by_others.conflict.hidden,
        broke=broke,
        verdicts=verdicts,
        grade=graded,
        drivers=drivers,
        fault=None if graded is None else _fault(evidence, by_others, broke, graded),
        plausibility=None if graded is None else plausibility_of(evidence),
        kind=kind,
        variant=variant,
        definitions=DEFINITIONS,
    )


def _inherited(requirement: Requirement, history: History, time_s: float, met: MetActor | None) -> bool:
    """Whether the ego inherited a violation at the release.

    It did if it was violated within 1 s, or the conflict with the actor that brought it about began within 1 s. It also
    did if the signal ahead was yellow or red then and the ego could not stop at leisure any more. A story prescribes
    what is there when it begins.
    """
    if history.evidence.tells_story:
        return False
    if not begins_after_release(time_s) or (met is not None and not begins_after_release(met.conflict.noticed_s)):
        return True
    if requirement.name != NO_RED_LIGHT_ENTRY:
        return False
    released = history.evidence.released
    frames = history.frames[released : released + round(time_s / STEP_S)]
    stopped = all(frame.signal in (Signal.YELLOW, Signal.RED) for frame in frames)
    return stopped and inherits_stop(frames[0].ego_speed_mps, frames[0].stop_line_m, time_s)


def _fault(evidence: Evidence, met: MetActor | None, broke: Sequence[str], graded: Grade) -> Fault:
    """Judges a violation caused by `met`; None means the ego's own driving."""
    if met is None:
        return fault(parts_of_violation(own=True, yields=None, other_broke=(), broke=broke, grade=graded))
    conflict, other = met.conflict, met.column
    other_broke = striker_offences(evidence, other, crossing=conflict.type is ConflictType.CROSSING)
    other_broke += endangered_ego(evidence, other, conflict)
    first = came_first(evidence, other)
    yields = has_to_yield(conflict.type, ground(evidence, other), other_broke, broke, first=first)
    return fault(parts_of_violation(own=False, yields=yields, other_broke=other_broke, broke=broke, grade=graded))


def _soonest_met(measures: Measures) -> int | None:
    """Finds the column of the actor with the earliest encounter, or None."""
    encounter_s = measures.assessment.others[ENCOUNTER]
    nearest = int(encounter_s.argmin())
    return nearest + 1 if encounter_s[nearest] < ENCOUNTER_CAP_S else None
