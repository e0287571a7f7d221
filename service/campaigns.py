"""States of campaigns and runs, and what may follow what. Pure; stored and published elsewhere.

queued ──> running ──> succeeded | failed
   │ ^        │ └────> cancelling ──> cancelled (or the end it had already reached)
   │ └────────┘        the server stopped under it: it will resume from its checkpoint
   └─────────────────> cancelled | failed
"""

from collections.abc import Collection
from enum import StrEnum

from service.errors import TransitionError


class State(StrEnum):
    """Where a campaign or a run stands."""

    QUEUED = "queued"
    RUNNING = "running"
    CANCELLING = "cancelling"
    CANCELLED = "cancelled"
    SUCCEEDED = "succeeded"
    FAILED = "failed"

    @property
    def final(self) -> bool:
        """Nothing follows this state."""
        return not TRANSITIONS[self]


TRANSITIONS: dict[State, frozenset[State]] = {
    State.QUEUED: frozenset({State.RUNNING, State.CANCELLED, State.FAILED}),
    State.RUNNING: frozenset({State.QUEUED, State.CANCELLING, State.SUCCEEDED, State.FAILED}),
    State.CANCELLING: frozenset({State.CANCELLED, State.SUCCEEDED, State.FAILED}),
    State.CANCELLED: frozenset(),
    State.SUCCEEDED: frozenset(),
    State.FAILED: frozenset(),
}


def advance(current: State, new: State) -> State:
    """`new`, once the table allows it after `current`.

    Raises:
      TransitionError: the table has no such transition.
    """
    if new not in TRANSITIONS[current]:
        allowed = ", ".join(sorted(TRANSITIONS[current])) or "nothing"
        raise TransitionError(f"state is {current}; got {new}, wanted {allowed}")
    return new


def campaign_state(current: State, runs: Collection[State]) -> State:
    """State of a campaign whose runs are in these states.

    A campaign ends with its last run. One failed run fails it, and one that was asked to cancel ends
    cancelled unless every run had already succeeded.

    Args:
      current: the campaign's state so far.
      runs: states of all its runs, never empty.
    """
    if current.final:
        return current
    if all(run.final for run in runs):
        return _verdict(current, runs)
    if current is State.CANCELLING:
        return current
    started = any(run is not State.QUEUED for run in runs)
    return State.RUNNING if started else State.QUEUED


def _verdict(current: State, runs: Collection[State]) -> State:
    if all(run is State.SUCCEEDED for run in runs):
        return State.SUCCEEDED
    if current is State.CANCELLING:
        return State.CANCELLED
    return State.FAILED if State.FAILED in runs else State.CANCELLED
