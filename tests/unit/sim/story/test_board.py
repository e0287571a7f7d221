"""States, priorities and execution counts of a story's elements."""

from typing import Any

import pytest

from risk_sac.sim.story.cast import DeviationRoom
from tests.unit.sim.story.straight import Drive, after, car, one_event, story_of


def speed(target: float, lasts_s: float = 0.0) -> dict[str, Any]:
    dynamics = {"shape": "linear", "by": "time", "value": lasts_s} if lasts_s else {}
    return {"kind": "speed", "target": target, "dynamics": dynamics}


def event(name: str, do: dict[str, Any], start: Any = None, **more: Any) -> dict[str, Any]:
    return {"name": name, "actions": [{"name": f"{name} action", "do": do}], "start": start, **more}


def act(*events: dict[str, Any], name: str = "act", **more: Any) -> dict[str, Any]:
    return {"name": name, "groups": [{"actors": ["lead"], "maneuvers": [{"events": list(events)}]}], **more}


def completed(of_kind: str, element: str, state: str = "complete", **more: Any) -> list[list[dict[str, Any]]]:
    return [[{"kind": "state", "of_kind": of_kind, "element": element, "state": state, **more}]]


def drive_of(*acts: dict[str, Any], **parts: Any) -> Drive:
    return Drive(story_of(acts, **parts), {"lead": car(50.0)})


@pytest.mark.parametrize(
    ("priority", "speeds"),
    [
        ("override", {1.0: 15.0, 2.0: 7.5, 3.0: 0.0}),  # the first event stops
        ("parallel", {1.0: 15.0, 2.0: 7.5, 3.0: 0.0}),  # its action is overridden by the other of the same kind
        ("skip", {1.0: 15.0, 2.0: 20.0, 3.0: 10.0, 4.0: 0.0}),  # the second waits for the first
    ],
)
def test_priorities(priority: str, speeds: dict[float, float]) -> None:
    first = event("first", speed(20.0, 2.0))
    second = event("second", speed(0.0, 2.0), after(1.0), priority=priority)
    drive = drive_of(act(first, second))
    for time_s, wanted in speeds.items():
        assert drive.to(time_s)["lead"].speed_mps == pytest.approx(wanted, abs=0.8)


def test_parallel_events_keep_what_they_do_not_share() -> None:
    offset = {"kind": "lane_offset", "target": 1.0, "shape": "cubic", "lateral_mps2": 1.0}
    drive = drive_of(act(event("first", speed(20.0, 2.0)), event("second", offset, after(1.0), priority="parallel")))
    assert drive.to(2.0)["lead"].speed_mps == pytest.approx(20.0)
    assert drive.to(5.0)["lead"].y_m == pytest.approx(1.0)


def test_override_stops_the_other_event_with_all_its_actions() -> None:
    offset = {"kind": "lane_offset", "target": 1.0, "shape": "cubic", "lateral_mps2": 0.5}
    drive = drive_of(act(event("first", offset), event("second", speed(20.0, 2.0), after(1.0))))
    kept = drive.to(1.0)["lead"].left_m
    assert drive.to(5.0)["lead"].left_m == pytest.approx(kept)
    assert drive.engine.states["story::act::group::maneuver::first"] == "complete"


@pytest.mark.parametrize(("most", "wanted"), [(1, 12.0), (3, 16.0)])
def test_event_runs_as_often_as_it_may(most: int, wanted: float) -> None:
    faster = {"kind": "speed", "target": {"to": "lead", "value": 2.0}}
    pulses = [[{"kind": "speed", "of": ["lead"], "rule": "less", "value": 20.0}]]
    drive = drive_of(act(event("again", faster, pulses, most=most)))
    assert drive.to(3.0)["lead"].speed_mps == pytest.approx(wanted)


def test_variables_count() -> None:
    adds = {"kind": "variable", "variable": "count", "value": 1.0, "how": "add"}
    drive = drive_of(
        act(event("counts", adds, after(0.0), most=3)),
        act(event("then", speed(20.0), [[{"kind": "variable", "variable": "count", "rule": "equal", "value": 3.0}]])),
        variables={"count": 0.0},
    )
    assert drive.to(0.1)["lead"].speed_mps == 10.0
    assert drive.to(0.2)["lead"].speed_mps == 20.0


def test_element_states_trigger_within_a_step() -> None:
    drive = drive_of(
        act(event("first", speed(20.0, 2.0)), name="one"),
        act(event("second", speed(5.0)), name="two", start=completed("act", "one", delay_s=1.0)),
    )
    assert drive.to(2.0)["lead"].speed_mps == pytest.approx(20.0)
    assert drive.to(2.9)["lead"].speed_mps == pytest.approx(20.0)
    assert drive.to(3.0)["lead"].speed_mps == pytest.approx(5.0)


@pytest.mark.parametrize(("state", "wanted_s"), [("start", 1.0), ("running", 1.0), ("end", 3.0), ("complete", 3.0)])
@pytest.mark.parametrize("element", ["first action", "first::first action"])
def test_transitions_and_states_of_an_action(state: str, element: str, wanted_s: float) -> None:
    first = event("first", speed(20.0, 2.0), after(1.0))
    drive = drive_of(act(first), stop=completed("action", element, state))
    while not drive.engine.stopped:
        drive.to(drive.engine.time_s + 0.1)
    assert drive.engine.time_s == pytest.approx(wanted_s, abs=0.101)


def test_stop_trigger_of_an_act_ends_its_actions() -> None:
    drive = drive_of(act(event("first", speed(20.0, 10.0)), stop=after(2.0)))
    kept = drive.to(2.0)["lead"].speed_mps
    assert drive.to(5.0)["lead"].speed_mps == pytest.approx(kept)


def test_group_may_be_done_again() -> None:
    faster = {"kind": "speed", "target": {"to": "lead", "value": 2.0}}
    one = act(event("again", faster, after(0.0)))
    one["groups"][0]["most"] = 2
    assert drive_of(one).to(1.0)["lead"].speed_mps == pytest.approx(14.0)


def test_triggering_actors_become_actors() -> None:
    near = [[{"kind": "distance", "of": ["lead", "other"], "to": "ego", "rule": "less", "value": 30.0}]]
    one = act(event("first", speed(0.0)), start=near)
    one["groups"][0] |= {"actors": [], "triggering": True}
    drive = Drive(story_of([one]), {"lead": car(100.0), "other": car(20.0)})
    played = drive.to(0.1)
    assert (played["lead"].speed_mps, played["other"].speed_mps) == (10.0, 0.0)


def test_same_story_plays_the_same_again() -> None:
    runs = [drive_of(act(event("first", speed(20.0, 3.3), after(0.7)))) for _ in range(2)]
    assert runs[0].to(6.0) == runs[1].to(6.0)
    assert runs[0].history == runs[1].history


def test_room_reaches_to_the_edges_of_the_road() -> None:
    drive = drive_of()
    stage = drive.engine._stage
    assert stage.room(stage.movers["lead"]) == pytest.approx(DeviationRoom(3 * 3.5 - 1.75 - 1.0, 1.75 - 1.0))


def test_init_actions_come_before_the_first_frame() -> None:
    init = [{"actor": "lead", "do": speed(3.0)}]
    assert drive_of(init=init).history[0]["lead"].speed_mps == 3.0


def test_stories_of_no_acts_play() -> None:
    assert drive_of().to(1.0)["lead"].x_m == pytest.approx(61.0)
    assert Drive(story_of([one_event("ghost", speed(3.0))]), {}).to(1.0) == {}
