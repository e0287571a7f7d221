"""Outcome of an episode, as a search learns from it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from risk_sac.records import Collision, Violation, valid_violations, worst_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter:
    """Outcome of an episode for the ego.

    Attributes:
      collision: its contact, if there was one.
      violations: of requirements that count, without contact.
      margins: least robustness of each requirement that counts, in scales.
      encounters_s: smallest time to encounter by adversary, s, while that is ahead and in sight and the ego moves.
      avoided_by: reference driver → whether it avoids a contact; empty where nothing is played as it is written.
    """

    collision: Collision | None = None
    violations: tuple[Violation, ...] = ()
    margins: Mapping[str, float] = field(default_factory=dict)
    encounters_s: Mapping[str, float] = field(default_factory=dict)
    avoided_by: Mapping[str, bool] = field(default_factory=dict)

    @property
    def valid_violations(self) -> tuple[Collision | Violation, ...]:
        """Lists the violations that make the episode a failure."""
        return valid_violations(self.collision, self.violations)

    @property
    def worst(self) -> Collision | Violation | None:
        """Returns the valid violation that counts most, see `worst_of`."""
        return worst_of(self.valid_violations)


NO_ENCOUNTER = Encounter()
