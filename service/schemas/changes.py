"""What a stream of events says."""

from datetime import datetime

from service.schemas.base import Body
from service.store.states import State


class StateChange(Body):
    """A campaign, or one of its runs, came into another state."""

    run_id: str | None
    """Null: the campaign itself."""
    state: State
    reason: str | None
    """Why, where it did not go as planned."""
    at: datetime
