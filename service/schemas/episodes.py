"""Episodes and contacts."""

from collections.abc import Mapping

from risk_sac import records
from risk_sac.metrics import Funnel
from risk_sac.run_folder import verified
from service.schemas.base import Body, Shown


class ReferenceOutcome(records.ReferenceOutcome, Shown):
    """How a reference driver fares in the ego's place."""


class Judgement(records.Judgement, Shown):
    """How a contact came about, and who would have prevented it. Times count from the adversaries' release."""

    drivers: Mapping[str, ReferenceOutcome]
    """Reference driver → how it fares; empty where the contact is not valid."""


class Collision(records.Collision, Shown):
    """The ego's first contact, with what is needed to judge it."""

    judgement: Judgement | None
    """Null in what was stored before contacts were judged."""


class Repetition(verified.Repetition, Shown):
    """How often an episode was played again, in a fresh process each time, and what came of it."""


class _OfARun(Shown):
    id: str
    run_id: str


class Episode(records.EpisodeRecord, _OfARun):
    """One episode."""

    collision: Collision | None
    wall_s: float
    funnel: Funnel | None
    """What the run's phase had found up to and including this episode, as it was told then; null in what is older."""
    repetition: Repetition | None
    """Of the first failure of its kind, once the run has ended; a failure that was not the same each time is flaky."""


class EpisodePage(Body):
    """Episodes in the order of their arrival."""

    items: list[Episode]
    next: str | None
    """Pass as `cursor` to continue; null at the end."""
