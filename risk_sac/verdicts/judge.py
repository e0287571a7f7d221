"""The judgement of one contact, from its evidence alone."""

from risk_sac.records import Judgement
from risk_sac.verdicts.conflict import Conflict, find_conflict, unresponsive
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.labels import broken, ground, manoeuvre, response, signature
from risk_sac.verdicts.reference import grade, reference_outcomes

DEFINITIONS = 4  # raise it with whatever changes a verdict; what was judged before says by which it was


def judge(evidence: Evidence, striker_id: str, *, valid: bool, conflict: Conflict | None = None) -> Judgement:
    """How the contact in the last frame came about, and, of a valid one, who would have prevented it.

    A valid contact passed every rule of `artefact_verdicts` and `validity_verdicts`. The conflict is found again if not
    given.

    Raises:
      ValueError: the striker is not there in the last frame.
    """
    striker = evidence.column(striker_id)
    conflict = conflict or find_conflict(evidence, striker)
    ego_manoeuvre, ego_response = manoeuvre(evidence), response(evidence, conflict)
    where, broke = ground(evidence, striker), broken(evidence, striker, conflict)
    drivers = reference_outcomes(evidence, striker, conflict) if valid else {}
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
        unresponsive=unresponsive(evidence, conflict),
        grade=grade(drivers) if valid else None,
        drivers=drivers,
        signature=signature(
            evidence, striker, conflict, manoeuvre=ego_manoeuvre, response=ego_response, ground=where, broke=broke
        ),
    )
