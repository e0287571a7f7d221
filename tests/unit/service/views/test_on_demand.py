import asyncio
import threading
from collections.abc import Awaitable, Callable

import pytest

from service.errors import BusyError, QuotaError
from service.views.on_demand import OnDemandCache

QUICK = -1  # a subject whose making does not wait


def play(
    scene: Callable[[OnDemandCache[int], threading.Event, list[int]], Awaitable[None]], at_once: int = 1
) -> list[int]:
    """Plays a scene with a gated cache; returns the order of making."""
    gate, order = threading.Event(), list[int]()

    def make(subject: int) -> bytes:
        assert subject == QUICK or gate.wait(600)
        order.append(subject)
        return b"%d" % subject

    async def begin() -> None:
        try:
            await scene(OnDemandCache(make, "things", at_once=at_once), gate, order)
        finally:
            gate.set()

    asyncio.run(begin())
    return order


async def ask(cache: OnDemandCache[int], key_id: str | None, *subjects: int) -> list[asyncio.Task[bytes]]:
    tasks = [asyncio.create_task(cache.get(subject, key_id)) for subject in subjects]
    await asyncio.sleep(0)  # after which each has its place, or is refused
    return tasks


def test_keys_take_turns_even_where_they_wait_for_the_same() -> None:
    async def scene(cache: OnDemandCache[int], gate: threading.Event, order: list[int]) -> None:
        busy = await ask(cache, "busy", 0, 1, 2, 3, 4)
        other = await ask(cache, "other", 9, 4)
        gate.set()
        assert await asyncio.gather(*busy, *other) == [b"0", b"1", b"2", b"3", b"4", b"9", b"4"]

    assert play(scene) == [0, 9, 1, 4, 2, 3]


def test_what_one_key_has_made_at_length_holds_up_no_other_key() -> None:
    async def scene(cache: OnDemandCache[int], gate: threading.Event, order: list[int]) -> None:
        long = await ask(cache, "busy", 0, 1, 2)
        assert await cache.get(QUICK, "other") == b"-1"
        gate.set()
        await asyncio.gather(*long)

    assert play(scene, at_once=2) == [QUICK, 0, 1, 2]


def test_what_there_is_waits_for_no_turn() -> None:
    async def scene(cache: OnDemandCache[int], gate: threading.Event, order: list[int]) -> None:
        gate.set()
        await cache.get(0, "one")
        gate.clear()
        waiting = await ask(cache, "one", 1)
        assert await cache.get(0, "one") == b"0"
        gate.set()
        await asyncio.gather(*waiting)

    assert play(scene) == [0, 1]


@pytest.mark.parametrize(("keys", "share"), [(["a"], 8), (["a", "b"], 5), (["a", "b", "c"], 4)])
def test_a_key_waits_for_its_share_of_different_subjects(keys: list[str], share: int) -> None:
    async def scene(cache: OnDemandCache[int], gate: threading.Event, order: list[int]) -> None:
        waiting = [task for key in reversed(keys[1:]) for task in await ask(cache, key, 100 + keys.index(key))]
        waiting += await ask(cache, "a", *range(share), 0)
        (refused,) = await ask(cache, "a", share)
        with pytest.raises(QuotaError, match=f"{share} things of this key wait to be made"):
            await refused
        gate.set()
        await asyncio.gather(*waiting)
        await cache.get(share, "a")

    assert len(play(scene)) == share + len(keys)


def test_without_keys_the_whole_queue_is_one_share() -> None:
    async def scene(cache: OnDemandCache[int], gate: threading.Event, order: list[int]) -> None:
        waiting = await ask(cache, None, *range(17))
        (refused,) = await ask(cache, None, 17)
        with pytest.raises(BusyError):
            await refused
        gate.set()
        await asyncio.gather(*waiting)

    assert play(scene) == list(range(17))
