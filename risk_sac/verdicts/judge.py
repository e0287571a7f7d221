"""The record of a contact and its judgement, from its evidence alone."""

from collections.abc import Sequence

from risk_sac.records import Collision, ConflictType, Judgement
from risk_sac.risk.measures import Measures
from risk_sac.risk.publish import worst_rss_margin
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.risk.ttc import TTC_CAP_S
from risk_sac.sim.collision import Contact
from risk_sac.types import STEP_S, Frame, Kind, Role
from risk_sac.verdicts.conflict import Conflict, find_conflict, unresponsive
from risk_sac.verdicts.definitions import DEFINITIONS
from risk_sac.verdicts.ego_part import ego_part
from risk_sac.verdicts.endangering import endangered_ego
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.fault import fault, has_to_yield, parts_of_contact
from risk_sac.verdicts.labels import ground, manoeuvre, response, signature
from risk_sac.verdicts.offences import ego_offences, striker_offences
from risk_sac.verdicts.reference import grade, reference_outcomes
from risk_sac.verdicts.severity import severity_of
from risk_sac.verdicts.validity import EpisodeFacts, artefact_verdicts, validity_verdicts

WARNING_STEPS = round(1.0 / STEP_S)  # what a failure is remembered by ends this long before the contact


def collision_of(
    contact: Contact,
    frame: Frame,
    released_s: float,
    evidence: Evidence,
    measures: Sequence[Measures],
    facts: EpisodeFacts,
) -> Collision:
    """The record of a contact in `frame`, the last one; `measures` begin with the release at `released_s`."""
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
        judgement=judge(evidence, other, valid=all(verdicts.values()), conflict=conflict),
    )


def judge(evidence: Evidence, striker_id: str, *, valid: bool, conflict: Conflict | None = None) -> Judgement:
    """Judges a contact: how it began, its fault, its severity, its grade.

    The contact is in the last frame. Only a valid one is graded, by the drivers that would have prevented it.

    A valid contact passed every rule of `artefact_verdicts` and `validity_verdicts`. The conflict is found again if not
    given.

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
    graded = grade(avoids) if valid else None
    yields = has_to_yield(conflict.type, where, broke, ego_broke)
    part = ego_part(evidence, striker, conflict, yields)
    severity, injury_risk = severity_of(evidence, striker)
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
        severity=severity,
        injury_risk=injury_risk,
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
            )
        ),
        signature=signature(
            evidence,
            striker,
            conflict,
            manoeuvre=ego_manoeuvre,
            response=ego_response,
            ground=where,
            broke=broke,
            ego_broke=ego_broke,
        ),
    )
