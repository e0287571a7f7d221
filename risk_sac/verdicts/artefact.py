"""The rules by which a contact is an artefact of the simulator or the control, and of nobody's driving."""

from collections.abc import Mapping
from dataclasses import dataclass

from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.grip import inside_grip

AFTER_RELEASE_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Handling:
    """What the simulator and the control did until the contact."""

    teleported: bool
    spawn_overlap: bool
    inside_limits: bool  # every adversary, up to the contact
    touched_before: bool  # the striking actor's body overlapped another one earlier
    ego_model_saw: bool  # SUMO's own boxes had the striker where ours had it


def artefact_verdicts(evidence: Evidence, striker: int, conflict: Conflict, handling: Handling) -> Mapping[str, bool]:
    """The rules of `ARTEFACT_RULES`, each with whether the contact passes it."""
    return {
        "no_teleport": not handling.teleported,
        "no_spawn_overlap": not handling.spawn_overlap,
        "conflict_after_release": conflict_after_release(conflict),
        "inside_limits": handling.inside_limits,
        "inside_grip": inside_grip(evidence, striker),
        "solid_bodies": not handling.touched_before,
        "ego_model_saw": handling.ego_model_saw,
    }


def conflict_after_release(conflict: Conflict) -> bool:
    """Whether the conflict was noticed 1 s or more after the adversaries' release: what was there they inherited."""
    return conflict.noticed_s >= AFTER_RELEASE_S - 1e-6
