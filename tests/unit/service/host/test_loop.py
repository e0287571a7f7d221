"""The event loop's selector, by a clock that only its own waiting and the test move, on a busy machine."""

import asyncio
import os
import select
import selectors
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from service.host import loop
from service.host.loop import BURST, PERIOD_S, GatheringSelector

WORK_S = 0.001  # that the loop does each time it is woken


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0
        self.slept = 0.0
        self.load = 2.0 * os.cpu_count()

    def monotonic(self) -> float:
        return self.now

    def select(
        self, read: list[int], write: list[int], exceptional: list[int], seconds: float
    ) -> tuple[list[int], ...]:
        found = select.select(read, write, exceptional, 0)
        if not any(found):
            self.now += seconds
            self.slept += seconds
        return found


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(loop, "time", clock)
    monkeypatch.setattr(loop, "select", clock)
    monkeypatch.setattr(os, "getloadavg", lambda: (clock.load,) * 3)
    return clock


@pytest.fixture
def ready() -> Iterator[Callable[[int], GatheringSelector]]:
    """Makes a selector on which so many connections have something to say, and a thread has or has not."""
    with ExitStack() as stack:

        def pair(said: bytes) -> socket.socket:
            ends = socket.socketpair()
            for end in ends:
                stack.enter_context(end)
            ends[1].send(said)
            return ends[0]

        def make(count: int, *, found: bool = False) -> GatheringSelector:
            selector = stack.enter_context(GatheringSelector())
            for said in (b"x" if found else b"", *[b"x"] * count):
                selector.register(pair(said), selectors.EVENT_READ)
            return selector

        yield make


def woken(selector: GatheringSelector, clock: Clock, seconds: float, every_s: float = WORK_S) -> int:
    """How often it wakes in some time, in which it always has something to wake for."""
    times, end = 0, clock.now + seconds
    while clock.now < end:
        assert selector.select(1.0)
        clock.now += every_s
        times += 1
    return times


def test_many_requests_gather(ready, clock):
    selector = ready(8)
    assert woken(selector, clock, 10.0) == pytest.approx(10.0 / PERIOD_S + BURST, abs=2)


def test_one_client_that_asks_as_fast_as_it_is_answered_is_not_held_up(ready, clock):
    assert woken(ready(1), clock, 10.0) > 0.85 * 10.0 / WORK_S


def test_nobody_waits_beside_idle_cores(ready, clock):
    clock.load = 0.5 * os.cpu_count()
    assert woken(ready(8), clock, 10.0) > 0.85 * 10.0 / WORK_S


def test_it_gathers_again_once_that_is_worth_it(ready, clock):
    few, many = ready(1), ready(8)
    woken(few, clock, 5.0)
    for key in list(many.get_map().values())[1:]:
        few.register(key.fileobj, key.events)
    woken(few, clock, 1.5)  # until it tries again
    assert woken(few, clock, 5.0) == pytest.approx(5.0 / PERIOD_S, abs=2)


def test_what_a_thread_has_found_is_passed_on_at_once(ready, clock):
    assert woken(ready(8, found=True), clock, 10.0) == pytest.approx(10.0 / WORK_S, abs=2)
    assert clock.slept == 0


def test_a_real_loop_names_the_file_by_which_threads_wake_it():
    selector = GatheringSelector()
    event_loop = asyncio.SelectorEventLoop(selector)
    (first,) = selector.get_map()
    event_loop.call_soon_threadsafe(lambda: None)
    assert select.select([first], [], [], 1)[0] == [first]
    event_loop.close()


def test_rare_requests_are_seen_at_once(ready, clock):
    woken(ready(8), clock, 10.0, every_s=1.5 * PERIOD_S)
    assert clock.slept == 0


def test_a_loop_at_work_does_not_wait(ready, clock):
    selector = ready(8)
    for _ in range(1000):
        assert len(selector.select(0)) == 8
    assert clock.slept == 0
