"""Answer cache before a small application that the tests control."""

import asyncio
from types import SimpleNamespace

import httpx
import pytest
from fastapi import FastAPI, Request, Response

from service.api.answer_cache import MOST_BYTES, AnswerCache, kept
from service.api.context import CALLER, Caller
from service.api.pages import entity_tag
from service.errors import StorageError
from service.keys import Scope

ADMIN = "admin"  # a caller that sees all projects


class Service:
    """Counts how often each campaign was shown.

    Attributes:
      revisions: of campaigns, as a store knows them.
      open: whether routes may answer.
      failing: whether they do.
    """

    def __init__(self):
        self.revisions = {"c1": 1, "c2": 1}
        self.shown = []
        self.open = asyncio.Event()
        self.open.set()
        self.failing = False
        self.body_bytes = 0
        app = FastAPI()
        app.add_api_route("/campaigns/{campaign_id}", self.show, methods=["GET", "POST"])
        app.add_api_route("/campaigns", self.show_all)
        app.add_middleware(AnswerCache)
        app.add_middleware(self.gate)
        app.state.context = SimpleNamespace(store=self)
        self.app = app
        self.client = httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test")

    def known_revision(self, campaign_id):
        revision = self.revisions.get(campaign_id)
        return None if revision is None else str(revision)

    def revision_of_all(self):
        return str(sorted(self.revisions.items()))

    def gate(self, app):
        async def let_in(scope, receive, send):
            if scope["type"] == "http":
                who = dict(scope["headers"]).get(b"who", ADMIN.encode()).decode()
                scope[CALLER] = Caller(who, Scope.ADMIN if who == ADMIN else Scope.READ, "k1")
            await app(scope, receive, send)

        return let_in

    async def show(self, campaign_id: str, request: Request) -> Response:
        revision = self.known_revision(campaign_id)
        return await self.answer(request, revision, campaign_id)

    async def show_all(self, request: Request) -> Response:
        return await self.answer(request, self.revision_of_all(), None)

    async def answer(self, request, revision, campaign_id):
        self.shown.append(revision)
        await self.open.wait()
        if self.failing:
            raise StorageError("refused")
        if revision is None:
            return Response(status_code=404)
        body = f"{request.scope[CALLER].project} {request.url.path} {revision}".encode().ljust(self.body_bytes)
        return kept(request, body, {"ETag": entity_tag(revision)}, revision, campaign_id)

    async def get(self, path="/campaigns/c1", who=ADMIN, **headers):
        return await self.client.get(path, headers={"who": who} | headers)

    async def ask(self, path="/campaigns/c1", who=ADMIN):
        return (await self.get(path, who)).text

    async def asking(self, count, path="/campaigns/c1"):
        """Tasks that have asked, and of which none is answered yet."""
        tasks = [asyncio.create_task(self.ask(path)) for _ in range(count)]
        await asyncio.sleep(0.05)
        return tasks


def asynchronous(test):
    def run():
        async def begin():
            await test(Service())

        asyncio.run(begin())

    run.__name__ = test.__name__
    return run


@asynchronous
async def test_an_answer_is_given_again_until_its_campaign_changes(service):
    seen = [await service.ask() for _ in range(3)]
    service.revisions["c2"] += 1
    seen.append(await service.ask())
    service.revisions["c1"] += 1
    seen += [await service.ask() for _ in range(2)]
    assert seen == [*["admin /campaigns/c1 1"] * 4, *["admin /campaigns/c1 2"] * 2]
    assert service.shown == ["1", "2"]


@asynchronous
async def test_an_answer_is_given_again_only_to_the_same_question_of_those_who_see_the_same(service):
    for _ in range(2):
        for who in ("ours", "theirs", ADMIN):
            for path in ("/campaigns/c1", "/campaigns/c2"):
                assert await service.ask(path, who) == f"{who} {path} 1"
        await service.ask("/campaigns/c1?again=1")
    assert len(service.shown) == 3 * 2 + 1


@asynchronous
async def test_all_who_ask_after_a_change_get_the_same_new_answer(service):
    await service.ask()
    service.revisions["c1"] = 2
    service.open.clear()
    tasks = await service.asking(200)
    service.open.set()
    assert await asyncio.gather(*tasks) == ["admin /campaigns/c1 2"] * 200
    assert service.shown == ["1", "2"]


@asynchronous
async def test_who_asks_while_an_older_answer_is_made_gets_what_was_stored_when_they_asked(service):
    """Answers to a fast-changing campaign are made in turn, not at once."""
    await service.ask()
    service.revisions["c1"] = 2
    service.open.clear()
    tasks = await service.asking(1)
    service.revisions["c1"] = 3
    tasks += await service.asking(50)
    service.open.set()
    assert await asyncio.gather(*tasks) == ["admin /campaigns/c1 2", *["admin /campaigns/c1 3"] * 50]
    assert service.shown == ["1", "2", "3"]


@asynchronous
async def test_a_failure_is_not_kept(service):
    await service.ask()
    service.revisions["c1"] = 2
    service.failing = True
    service.open.clear()
    tasks = await service.asking(3)
    service.open.set()
    told = await asyncio.gather(*tasks, return_exceptions=True)
    assert [str(each) for each in told] == ["refused"] * 3
    service.failing = False
    assert await service.ask() == "admin /campaigns/c1 2"


@asynchronous
async def test_one_who_leaves_does_not_keep_the_others_waiting(service):
    await service.ask()
    service.revisions["c1"] = 2
    service.open.clear()
    leaving, *staying = await service.asking(3)
    leaving.cancel()
    with pytest.raises(asyncio.CancelledError):
        await leaving
    service.open.set()
    assert await asyncio.gather(*staying) == ["admin /campaigns/c1 2"] * 2


@asynchronous
async def test_one_who_reads_slowly_does_not_keep_the_others_waiting(service):
    await service.ask()
    service.revisions["c1"] = 2

    async def never(_=None):
        await asyncio.Event().wait()

    scope = {"type": "http", "method": "GET", "path": "/campaigns/c1", "query_string": b"", "headers": []}
    reading = asyncio.create_task(service.app(scope, never, never))
    await asyncio.sleep(0.05)
    assert await asyncio.wait_for(service.ask(), 5) == "admin /campaigns/c1 2"
    assert service.shown == ["1", "2"]
    reading.cancel()


@asynchronous
async def test_only_so_much_is_kept_and_the_newest_of_it(service):
    service.body_bytes = MOST_BYTES // 8
    for number in range(20):
        await service.ask(f"/campaigns/c1?{number}")
    service.shown.clear()
    for number in range(14, 20):
        await service.ask(f"/campaigns/c1?{number}")
    assert service.shown == []
    await service.ask("/campaigns/c1?0")
    assert service.shown == ["1"]
