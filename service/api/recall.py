"""Answers that were given before are given again before a route is even looked for.

Most polls find nothing new, or nothing but another episode, of which a busy service has many a second. So an answer is
given again as long as nothing has happened, and for a second if nothing but episodes has.
"""

import time
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

from fastapi import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.access import CALLER, Caller
from service.api.answers.representations import Representation
from service.store.reading import Store
from service.store.revisions import Mark

EPISODES_S = 1.0  # for which an answer holds although episodes have come; nobody is told to ask again sooner
MOST_BYTES = 16 << 20  # of all that is kept
OVERHEAD_BYTES = 2000  # of each answer, about, beyond its body and what was asked
ANSWER = "risk_sac.answer"  # in the ASGI scope, where a route leaves what may be given again
RECALLED = "risk_sac.recalled"  # there as well, if an answer was given again

Asked = tuple[Caller, str, bytes]  # by whom, path and query


@dataclass(frozen=True, slots=True)
class Answer:
    """What was answered, and when that holds again."""

    representation: Representation
    mark: Mark  # what the answer shows
    campaign_id: str | None  # of whom; None: of all
    at: float

    def holds(self, store: Store) -> bool:
        """Whether the same would be answered now, but for young episodes."""
        now = store.mark_of_all() if self.campaign_id is None else store.mark(self.campaign_id)
        if now == self.mark:
            return True
        young = time.monotonic() - self.at < EPISODES_S
        return young and now is not None and (now.settled, now.refusal) == (self.mark.settled, self.mark.refusal)


def remember(request: Request, representation: Representation, mark: Mark, campaign_id: str | None = None) -> None:
    """Let an answer be given again.

    Args:
      request: that it answers; only who made it gets the same answer again.
      representation: the answer.
      mark: no newer than what it shows.
      campaign_id: the only campaign that it shows, if there is only one.
    """
    request.scope[ANSWER] = Answer(representation, mark, campaign_id, time.monotonic())


class Recall:
    """ASGI middleware, innermost: the guards have let the caller in."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._answers: OrderedDict[Asked, tuple[Answer, dict[str, Any]]] = OrderedDict()
        self._bytes = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass on and keep the answer."""
        if scope["type"] != "http" or scope["method"] != "GET" or CALLER not in scope:
            await self._app(scope, receive, send)
            return
        asked: Asked = (scope[CALLER], scope["path"], scope["query_string"])
        answer, routed = self._answers.get(asked, (None, {}))
        if answer is None or not answer.holds(scope["app"].state.context.store):
            await self._app(scope, receive, send)
            if ANSWER in scope:
                self._keep(asked, scope)
            return
        scope.update(routed)
        scope[RECALLED] = True
        await answer.representation.response(Request(scope))(scope, receive, send)

    def _keep(self, asked: Asked, scope: Scope) -> None:
        answer: Answer = scope[ANSWER]
        self._drop(asked)
        self._answers[asked] = answer, {name: scope[name] for name in ("route", "path_params")}
        self._bytes += _size(asked, answer)
        while self._bytes > MOST_BYTES:
            self._drop(next(iter(self._answers)))

    def _drop(self, asked: Asked) -> None:
        answer, _ = self._answers.pop(asked, (None, {}))
        if answer is not None:
            self._bytes -= _size(asked, answer)


def _size(asked: Asked, answer: Answer) -> int:
    _, path, query = asked
    return len(answer.representation.body) + len(path) + len(query) + OVERHEAD_BYTES
