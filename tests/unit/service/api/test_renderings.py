import asyncio
import time

import pytest

from service.api.renderings import KEPT, NEGLIGIBLE_S, Renderings
from service.errors import StorageError


class Campaigns:
    """Renders how often each campaign was rendered."""

    def __init__(self, busy_s=0.0):
        self.busy_s = busy_s
        self.rendered = {}

    def render(self, campaign_id):
        self.rendered[campaign_id] = count = self.rendered.get(campaign_id, 0) + 1
        until = time.thread_time() + self.busy_s
        while time.thread_time() < until:
            pass
        return f"{campaign_id} {count}"


def test_all_who_ask_at_once_get_the_same_rendering():
    async def ask():
        return await asyncio.gather(*(renderings.get("c1", "1") for _ in range(200)))

    campaigns = Campaigns()
    renderings = Renderings(campaigns.render)
    assert asyncio.run(ask()) == ["c1 1"] * 200


def test_each_revision_is_rendered_once_and_each_campaign_for_itself():
    async def ask():
        asked = [("c1", "1"), ("c1", "1"), ("c2", "1"), ("c1", "2"), ("c1", "2")]
        return [await renderings.get(*each) for each in asked]

    renderings = Renderings(Campaigns().render)
    assert asyncio.run(ask()) == ["c1 1", "c1 1", "c2 1", "c1 2", "c1 2"]


def test_who_asks_while_an_older_revision_is_rendered_gets_what_was_stored_when_he_asked():
    async def ask():
        first = asyncio.create_task(renderings.get("c1", "1"))
        await asyncio.sleep(0.001)
        return await asyncio.gather(first, *(renderings.get("c1", "2") for _ in range(50)))

    renderings = Renderings(Campaigns(busy_s=NEGLIGIBLE_S / 2).render)
    assert asyncio.run(ask()) == ["c1 1", *["c1 2"] * 50]


def test_a_dear_rendering_lasts_unless_it_must_not():
    async def ask():
        shown = [await renderings.get("c1", str(revision)) for revision in range(5)]
        renderings.expire("c1")
        return [*shown, await renderings.get("c1", "5")]

    renderings = Renderings(Campaigns(busy_s=2 * NEGLIGIBLE_S).render)
    assert asyncio.run(ask()) == [*["c1 1"] * 5, "c1 2"]


def test_what_must_not_last_does_not_even_where_it_is_being_rendered():
    async def ask():
        first = asyncio.create_task(renderings.get("c1", "1"))
        await asyncio.sleep(0.001)
        renderings.expire("c1")
        return [await first, await renderings.get("c1", "2")]

    renderings = Renderings(Campaigns(busy_s=2 * NEGLIGIBLE_S).render)
    assert asyncio.run(ask()) == ["c1 1", "c1 2"]


def test_a_failure_is_told_to_all_who_wait_and_then_tried_again():
    def render(campaign_id):
        tried.append(campaign_id)
        if len(tried) == 1:
            raise StorageError("refused")
        return "there"

    async def ask():
        told = await asyncio.gather(*(renderings.get("c1", "1") for _ in range(3)), return_exceptions=True)
        return told, await renderings.get("c1", "1")

    tried = []
    renderings = Renderings(render)
    told, then = asyncio.run(ask())
    assert [str(each) for each in told] == ["refused"] * 3
    assert then == "there"


def test_one_who_leaves_does_not_take_the_rendering_along():
    async def ask():
        leaving = asyncio.create_task(renderings.get("c1", "1"))
        staying = asyncio.create_task(renderings.get("c1", "1"))
        await asyncio.sleep(0)
        leaving.cancel()
        with pytest.raises(asyncio.CancelledError):
            await leaving
        return await staying

    renderings = Renderings(Campaigns(busy_s=0.01).render)
    assert asyncio.run(ask()) == "c1 1"


def test_only_what_was_asked_for_lately_is_kept():
    async def ask():
        for number in range(3 * KEPT):
            await renderings.get("often", "1")
            await renderings.get(f"c{number}", "1")

    campaigns = Campaigns()
    renderings = Renderings(campaigns.render)
    asyncio.run(ask())
    assert len(renderings._newest) == KEPT
