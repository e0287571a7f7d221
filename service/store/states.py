"""States of campaigns and runs and their transitions. Pure.

queued ──> running ──> succeeded | failed
   │ ^        │ └────> cancelling ──> cancelled (or the end it had already reached)
   │ ├────────┤        its worker died or the server stopped: it will resume from its checkpoint
   │ └─ paused <┘      the disk refused: it goes on when there is room
   └─────────────────> cancelled | failed
"""

from collections.abc import Collection

from risk_sac.records import State
from service.errors import TransitionError

TRANSITIONS: dict[State, frozenset[State]] = {
    State.QUEUED: frozenset({State.RUNNING, State.PAUSED, State.CANCELLED, State.FAILED}),
    State.RUNNING: frozenset({State.QUEUED, State.PAUSED, State.CANCELLING, State.SUCCEEDED, State.FAILED}),
    State.PAUSED: frozenset({State.QUEUED, State.RUNNING, State.CANCELLING, State.CANCELLED, State.FAILED}),
    State.CANCELLING: frozenset({State.CANCELLED, State.SUCCEEDED, State.FAILED}),
    State.CANCELLED: frozenset(),
    State.SUCCEEDED: frozenset(),
    State.FAILED: frozenset(),
}
# What a run comes back as when the server that had it in hand is gone, or the disk that refused it has room again.
RESUMED = {State.RUNNING: State.QUEUED, State.PAUSED: State.QUEUED, State.CANCELLING: State.CANCELLED}


def advance(current: State, new: State) -> State:
    """`new`; TransitionError unless it may follow `current`."""
    if new not in TRANSITIONS[current]:
        allowed = ", ".join(sorted(TRANSITIONS[current])) or "nothing"
        raise TransitionError(f"state is {current}; got {new}, wanted {allowed}")
    return new


def campaign_state(current: State, runs: Collection[State]) -> State:
    """Returns the state of a campaign whose runs (at least one) have these states.

    A campaign ends with its last run. One failed run fails it; a cancelled campaign ends as cancelled unless every run
    had already succeeded.
    """
    if current.final:
        return current
    if all(run.final for run in runs):
        return _verdict(current, runs)
    if current is State.CANCELLING:
        return current
    if State.PAUSED in runs:
        return State.PAUSED
    started = any(run is not State.QUEUED for run in runs)
    return State.RUNNING if started else State.QUEUED


def _verdict(current: State, runs: Collection[State]) -> State:
    if all(run is State.SUCCEEDED for run in runs):
        return State.SUCCEEDED
    if current is State.CANCELLING:
        return State.CANCELLED
    return State.FAILED if State.FAILED in runs else State.CANCELLED
