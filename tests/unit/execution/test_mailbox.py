import pytest

from risk_sac.execution.executor import Exited
from risk_sac.execution.mailbox import Mailbox

GONE = Exited(None)


def mailbox(*messages):
    box = Mailbox()
    box.admit(1, 2)
    for message in messages:
        box.put(*message)
    return box


def test_messages_come_in_the_order_of_their_arrival():
    box = mailbox((1, 2, "a"), (1, 2, "b"), (1, 2, GONE))
    assert box.take(0.01) == [(1, "a"), (1, "b"), (1, GONE)]
    assert box.take(0.01) == []


@pytest.mark.parametrize("attempt", [1, 3])
def test_no_other_attempt_is_heard(attempt):
    assert mailbox((1, attempt, "a"), (1, attempt, GONE), (1, 2, "b")).take(0.01) == [(1, "b")]


def test_nothing_is_heard_after_the_end():
    box = mailbox((1, 2, GONE), (1, 2, "late"), (1, 2, GONE))
    assert box.take(0.01) == [(1, GONE)]
    box.put(1, 2, "later")
    assert box.take(0.01) == []


def test_what_waits_of_an_overtaken_attempt_is_dropped():
    box = mailbox((1, 2, "old"), (1, 2, GONE))
    box.admit(1, 3)
    box.put(1, 2, "old")
    box.put(1, 3, "new")
    assert box.take(0.01) == [(1, "new")]


def test_runs_do_not_fence_each_other():
    box = mailbox((1, 2, "a"))
    box.admit(2, 7)
    box.put(2, 7, "b")
    assert box.take(0.01) == [(1, "a"), (2, "b")]


def test_an_attempt_that_could_not_begin_is_not_heard_and_can_be_made_again():
    box = mailbox((1, 2, "a"))
    box.dismiss(1)
    assert box.take(0.01) == []
    box.admit(1, 2)


def test_an_older_attempt_is_refused():
    with pytest.raises(ValueError, match="attempt is 2; run 1 is at attempt 2, so wanted a later one"):
        mailbox().admit(1, 2)


def test_a_wait_is_cut_short():
    box = mailbox()
    box.wake()
    assert box.take(600) == []
