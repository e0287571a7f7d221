from risk_sac.execution.local import Lease, Signs

FOREVER = 1e9


def seconds_until_lost(lease, signs, watched_s=0.2):
    """Time until the worker with these signs of life, one set after another, counts as lost; the last set stays."""
    signs = list(signs)
    for count in range(1, 1000):
        if lease.passed(watched_s, signs.pop(0) if len(signs) > 1 else signs[0]):
            return round(count * watched_s, 6)
    return None


def test_a_worker_that_neither_speaks_nor_works_is_lost_after_its_lease():
    assert seconds_until_lost(Lease(4.0, FOREVER), [Signs()]) == 4.0


def test_words_and_processor_time_are_signs_of_life():
    speaks = [Signs(words=count) for count in range(1, 51)]
    works = [Signs(processor_s=0.01 * count) for count in range(1, 51)]
    for signs in (speaks, works):
        assert seconds_until_lost(Lease(4.0, FOREVER), signs) == 50 * 0.2 + 4.0


def test_a_worker_that_stays_busy_without_an_episode_is_lost_when_it_stalls():
    busy = [Signs(words=count, processor_s=float(count)) for count in range(1000)]
    assert seconds_until_lost(Lease(4.0, 60.0), busy) == 60.0


def test_time_that_nobody_watched_is_not_held_against_a_worker():
    lease = Lease(4.0, FOREVER)
    lease.passed(3.9, Signs())
    assert lease.passed(0.0, Signs()) is None
