"""/v1/campaigns/{id}/events: resumable server-sent events."""

from typing import Annotated

import anyio
from fastapi import APIRouter, Header, Query, Response
from sse_starlette import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from service.api.context import CurrentCaller, Service
from service.api.pages import INVALID, UNKNOWN, Responses
from service.api.problems import invalid_field
from service.api.stream import decode_position
from service.store.reading import Store

HEARTBEAT_S = 15.0
GRACE_S = 1.0  # for streams to end by themselves when the server stops

EXAMPLE = {
    "id": "YzRkYThkZmRiYWQ1NDYwNDUtMTU=",
    "event": "failure",
    "data": '{"id":"low-risk-sac-0-search-11","run_id":"low-risk-sac-0","outcome":"failure", …}',
}
# What each event is made of: OpenAPI before 3.2 has no other place for it.
EVENT = {
    "type": "object",
    "required": ["id", "event", "data"],
    "properties": {
        "id": {"type": "string", "description": "Come back with it as Last-Event-ID."},
        "event": {"enum": ["episode", "failure", "state"]},
        "data": {
            "type": "string",
            "contentMediaType": "application/json",
            "contentSchema": {
                "anyOf": [{"$ref": "#/components/schemas/Episode"}, {"$ref": "#/components/schemas/StateChange"}]
            },
        },
    },
}
EVENTS: Responses = {
    200: {
        "description": "`episode`, or `failure` for a valid one of a search: an Episode, with the funnel of its run so"
        " far. `state`: a StateChange. A run's end comes after all its episodes; the campaign's ends the stream.",
        "content": {"text/event-stream": {"schema": EVENT, "example": EXAMPLE}},
    },
    204: {"description": "The campaign has ended and all events were sent; do not reconnect."},
}
LastEventId = Annotated[
    str | None,
    Header(alias="Last-Event-ID", max_length=100, description="The `id` of the last event that was received."),
]

Newest = Annotated[
    int | None,
    Query(
        ge=0,
        le=1000,
        description="Begin with so many of the newest events; without it with the campaign's first. Last-Event-ID"
        " goes before it.",
    ),
]

router = APIRouter(prefix="/v1/campaigns", tags=["campaigns"], responses=INVALID | UNKNOWN)


@router.get("/{campaign_id}/events", response_class=Response, responses=EVENTS)
async def get_events(
    campaign_id: str,
    service: Service,
    caller: CurrentCaller,
    last_event_id: LastEventId = None,
    newest: Newest = None,
) -> Response:
    """Server-sent events (episodes, failures, states): all, or after the last received."""
    position, ended = await run_in_threadpool(_start, service.store, campaign_id, caller.sees, last_event_id, newest)
    if position is None:
        return Response(status_code=204)
    stopping = anyio.Event()
    return EventSourceResponse(
        service.streams.follow(campaign_id, position, stopping, ended=ended),
        ping=HEARTBEAT_S,
        ping_message_factory=lambda: ServerSentEvent(comment="alive", sep="\n"),
        shutdown_event=stopping,
        shutdown_grace_period=GRACE_S,
    )


def _start(
    store: Store, campaign_id: str, project: str | None, event_id: str | None, newest: int | None
) -> tuple[int | None, bool]:
    """Returns the start position, None if all sent, and whether it ended."""
    store.campaign(campaign_id, project)  # 404 unless the caller may see it
    position = _position(store, campaign_id, event_id, newest)
    if position is None:
        raise invalid_field(
            "Last-Event-ID", event_id, "the id of an event of this campaign, unchanged; else leave it out"
        )
    ended = store.campaign(campaign_id, project).state.final  # after the position, so later events count as later
    told = ended and not store.events(campaign_id, after=position, limit=1).items
    return None if told else position, ended


def _position(store: Store, campaign_id: str, event_id: str | None, newest: int | None) -> int | None:
    if event_id:
        return decode_position(store, campaign_id, event_id)
    return 0 if newest is None else max(0, store.count_of_events(campaign_id) - newest)
