"""What is asked of a record that is still plain JSON, as `service.store.stored.PlainEpisode` has it. Pure."""

from collections.abc import Mapping
from typing import Any

from risk_sac.verdicts.distinct import Cell, cell

Plain = Mapping[str, Any]
"""A JSON object; a number that is not finite is a string, see `risk_sac.records.Record`."""


class Kinds:
    """Tells which failures are the first of their kind, as `risk_sac.verdicts.distinct.DistinctFailures` does."""

    def __init__(self) -> None:
        self._found: set[tuple[str, Cell]] = set()

    def add(self, collision: Plain) -> bool:
        """Whether none of those before was alike."""
        niche = signature_of(collision), _cell(collision)
        new = niche not in self._found
        self._found.add(niche)
        return new


def signature_of(collision: Plain) -> str:
    """Its judgement's; of one stored before contacts were judged, its striker."""
    judged = collision.get("judgement")
    signature: str = judged["signature"] if judged else _unjudged(collision)
    return signature


def _unjudged(collision: Plain) -> str:
    return f"unjudged {collision['other_role']} {collision['other_kind']}"


def _cell(collision: Plain) -> Cell:
    judged = collision.get("judgement")
    from_conflict_s = float(collision["time_s"]) - float(judged["conflict_s"]) if judged else 0.0
    return cell((float(collision["ego_speed_mps"]), float(collision["other_speed_mps"]), from_conflict_s))
