from service.runs.workers import start_order
from service.store.queries import QueuedPlace

QUEUED = [QueuedPlace(number, project) for number, project in enumerate("aaabbc")]


def test_runs_start_by_the_fewest_slots_of_their_project_then_by_age():
    assert list(start_order(QUEUED, {})) == [0, 3, 5, 1, 4, 2]
    assert list(start_order(QUEUED, {"a": 2, "c": 1})) == [3, 4, 5, 0, 1, 2]
    assert list(start_order(QUEUED, {}, out={"a"})) == [3, 5, 4]
