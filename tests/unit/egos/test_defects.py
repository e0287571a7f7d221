"""Each defect changes what its sentence says, and nothing else."""

import csv
import math
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.defects.catalogue import DEFECTS, Planted, planted, version_of
from risk_sac.egos.defects.condition import Condition
from risk_sac.egos.defects.conjunction import Conditional
from risk_sac.egos.defects.perception import ShortSight
from risk_sac.egos.defects.planning import LateBraking
from risk_sac.egos.registry import pinned
from risk_sac.egos.seam import Command, Control, EpisodeStart, Perceived, Vehicle
from risk_sac.egos.shipped import IdmAeb
from risk_sac.world.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, Kind, Signal, X, Y

CAR, TRUCK, WALKER = (Kind.VEHICLE, 4.6, 1.85), (Kind.VEHICLE, 8.0, 2.4), (Kind.PEDESTRIAN, 0.5, 0.5)
Actor = tuple[str, tuple[Kind, float, float], float, float, float, float]
"""Name, body, m ahead of the ego's centre, m to its left, velocity along and across, m/s."""
ADMISSION = Path(__file__).parents[3] / "risk_sac/report/measured/admission.csv"  # of risk_sac.lab.figures.defects
LEAST_SCENES = 500
TIERS = ADMISSION.with_name("tiers.csv")
LEAST_CONJUNCTION_SCENES = 30
PYTHON = [name for name, defect in DEFECTS.items() if defect.kind != "sumo"]
CONJUNCTIONS = {name for name, defect in DEFECTS.items() if defect.when}


def seen(*actors: Actor, time_s: float = 1.5, speed: float = 10.0, turn: float = 0.0, **changes: Any) -> Perceived:
    """Perception of an ego on a straight road, `turn` rad from east."""
    all_actors = (("ego", CAR, 0.0, 0.0, speed, 0.0), *actors)
    state = np.full((11, len(all_actors)), np.nan)
    cos, sin = math.cos(turn), math.sin(turn)
    for i, (_, (_, length, width), ahead, left, along, across) in enumerate(all_actors):
        state[[X, Y], i] = ahead * cos - left * sin, ahead * sin + left * cos
        state[[VX, VY], i] = along * cos - across * sin, along * sin + across * cos
        state[SPEED, i] = math.hypot(along, across)
        state[HEADING, i] = turn if i == 0 else math.atan2(state[VY, i], state[VX, i])
        state[[LENGTH, WIDTH], i] = length, width
    stations, still = np.array([0.0, 100.0, 300.0]), np.zeros(3)
    path = np.array([stations * cos, stations * sin, stations, still + turn, still + 13.9, still + cos, still + sin])
    whole = Perceived(
        time_s=time_s,
        ids=tuple(actor[0] for actor in all_actors),
        kind=np.array([actor[1][0] for actor in all_actors], dtype=np.int8),
        state=state,
        path=path,
        station_m=2.3,
        offset_m=0.0,
        signal=Signal.NONE,
        stop_line_m=math.inf,
    )
    return whole._replace(**changes)


class Listener:
    """Keeps what it perceives, and commands what it was told to."""

    def __init__(self, *commands: Command) -> None:
        self.commands = list(commands)
        self.seen: list[Perceived] = []

    def reset(self, episode: EpisodeStart) -> None: ...

    def act(self, perceived: Perceived) -> Command:
        self.seen.append(perceived)
        return self.commands.pop(0) if self.commands else Control(0.0)

    def close(self) -> None: ...


def decorator_of(name: str) -> Any:
    return getattr(import_module(f"risk_sac.egos.defects.{DEFECTS[name].kind}"), DEFECTS[name].decorator)


def begun(name: str, ego: Listener, grip: float = 9.81) -> Any:
    found = decorator_of(name)(ego, DEFECTS[name].parameter.value)
    vehicle = Vehicle(length_m=4.6, width_m=1.85, grip_mps2=grip)
    found.reset(EpisodeStart(seed=0, net="", route=(), vehicle=vehicle, step_s=0.1))
    return found


def perceived(name: str, *frames: Perceived) -> list[Perceived]:
    ego = Listener()
    defective = begun(name, ego)
    for frame in frames:
        before = frame.state.copy()
        defective.act(frame)
        np.testing.assert_array_equal(frame.state, before)  # the ego without the defect sees the same frame
    return ego.seen


def commanded(name: str, *accelerations: float, frame: Perceived | None = None, grip: float = 9.81) -> list[float]:
    defective = begun(name, Listener(*(Control(a) for a in accelerations)), grip)
    return [defective.act(frame or seen()).accel_mps2 for _ in accelerations]


def left_over(name: str, *actors: Actor, turn: float = 0.0, speed: float = 10.0) -> Sequence[str]:
    return perceived(name, seen(*actors, turn=turn, speed=speed))[0].ids[1:]


def velocity(name: str, *actors: Actor) -> list[tuple[float, float]]:
    (frame,) = perceived(name, seen(*actors))
    return [(round(vx, 6), round(vy, 6)) for vx, vy in frame.state[[VX, VY], 1:].T.tolist()]


def walker(ahead: float, left: float, along: float = 0.0, across: float = 1.4) -> Actor:
    return ("walker", WALKER, ahead, left, along, across)


def car(ahead: float, left: float = 0.0, along: float = 10.0, across: float = 0.0, name: str = "car") -> Actor:
    return (name, CAR, ahead, left, along, across)


@pytest.mark.parametrize("turn", [0.0, 2.0, -1.0])
def test_sight_ends_at_a_range_and_at_a_sector_on_one_side(turn):
    assert left_over("short-sight", car(24.0), walker(26.0, 0.0), turn=turn) == ("car",)
    assert left_over("pedestrian-range", car(50.0), walker(16.0, 0.0), turn=turn) == ("car",)
    assert left_over("pedestrian-range", walker(14.0, 0.0), turn=turn) == ("walker",)
    for degrees, left, right in ((10, True, True), (35, False, False), (60, True, True), (170, True, True)):
        ahead, beside = 20.0 * math.cos(math.radians(degrees)), 20.0 * math.sin(math.radians(degrees))
        assert (left_over("blind-left", car(ahead, beside), turn=turn) != ()) is left
        assert left_over("blind-left", car(ahead, -beside), turn=turn) == ("car",)
        assert (left_over("blind-right", car(ahead, -beside), turn=turn) != ()) is right
        assert left_over("blind-right", car(ahead, beside), turn=turn) == ("car",)


def test_every_tenth_frame_is_empty():
    frames = perceived("drops-frames", *(seen(car(20.0)) for _ in range(20)))
    assert [len(frame.ids) for frame in frames] == [*[2] * 9, 1] * 2


def test_others_are_seen_late_and_the_ego_in_time():
    frames = perceived("latency", *(seen(car(20.0 + k), speed=10.0 + k) for k in range(8)))
    assert [frame.state[X, 1] for frame in frames] == [20, 20, 20, 20, 20, 20, 21, 22]
    assert [frame.state[SPEED, 0] for frame in frames] == [10 + k for k in range(8)]


def test_bodies_are_short_and_others_beside_where_they_are():
    (frame,) = perceived("trucks-as-cars", seen(("truck", TRUCK, 20.0, 3.0, 0.0, 0.0), car(40.0)))
    assert frame.state[LENGTH].tolist() == [4.6, 4.6, 4.6]
    for turn in (0.0, 2.5):
        (frame,) = perceived("lateral-bias", seen(car(20.0, -3.0), turn=turn))
        right = seen(car(20.0, -2.2), turn=turn)
        np.testing.assert_allclose(frame.state[[X, Y]], right.state[[X, Y]], atol=1e-9)


def test_velocities_are_not_measured():
    assert velocity("still-pedestrians", walker(20, -3), car(30)) == [(0.0, 0.0), (10.0, 0.0)]
    assert velocity("still-pedestrians", walker(20, -3, across=3.0)) == [(0.0, 3.0)]
    assert velocity("radial-velocity", car(20, 0, 5.0, 2.0), walker(10, -3)) == [(5.0, 0.0), (0.0, 1.4)]


def test_what_is_hidden_is_forgotten():
    truck = ("truck", TRUCK, 15.0, -3.0, 0.0, 0.0)
    assert left_over("no-memory", truck, walker(30.0, -6.0)) == ("truck",)
    assert left_over("no-memory", truck, walker(30.0, 6.0)) == ("truck", "walker")


def test_velocities_are_those_of_a_second_ago():
    frames = perceived("stale-velocity", *(seen(car(20, along=10 - k, across=k)) for k in range(14)))
    assert [round(frame.state[VX, 1]) for frame in frames] == [10] * 11 + [9, 8, 7]
    assert [round(frame.state[VY, 1]) for frame in frames] == [0] * 11 + [1, 2, 3]


def test_two_tracks_that_meet_are_swapped():
    (frame,) = perceived("swaps-tracks", seen(car(20, 0, 8.0), walker(24, 2), car(60, name="far")))
    assert frame.ids == ("ego", "walker", "car", "far")
    assert frame.state[VX].tolist() == pytest.approx([10.0, 0.0, 8.0, 10.0])
    assert frame.state[X].tolist() == pytest.approx([0.0, 20.0, 24.0, 60.0])
    apart = seen(car(20, 0, 8.0), walker(24, 6))
    assert perceived("swaps-tracks", apart)[0].ids == apart.ids


def test_new_tracks_are_late_but_not_those_of_the_first_frame():
    frames = [seen(car(20), *([walker(30, 3)] if k >= 2 else []), time_s=1.5 + k / 10) for k in range(14)]
    assert [len(frame.ids) for frame in perceived("late-tracks", *frames)] == [2] * 12 + [3] * 2


def test_pedestrians_vanish_beside_vehicles_and_after_standing():
    truck = ("truck", TRUCK, 20.0, -3.0, 1.0, 0.0)
    assert left_over("merges-pedestrians", truck, walker(25.0, -3.0)) == ("truck",)
    assert left_over("merges-pedestrians", truck, walker(26.0, -3.0)) == ("truck", "walker")
    stood = [seen(walker(20, -4, across=0.0 if k < 20 else 2.0)) for k in range(22)]
    assert [len(frame.ids) for frame in perceived("drops-standing", *stood)] == [2] * 19 + [1] * 3
    cars = [seen(car(20, along=0.0)) for _ in range(22)]
    assert {len(frame.ids) for frame in perceived("drops-standing", *cars)} == {2}


def test_a_braking_leader_is_expected_to_drive_on():
    frames = perceived("leader-drives-on", *(seen(car(20, along=10 - k / 2)) for k in range(18)))
    assert [round(float(frame.state[SPEED, 1]), 3) for frame in frames] == [10.0] * 16 + [9.5, 9.0]
    assert velocity("leader-drives-on", car(20, -4, 0.0, 5.0)) == [(0.0, 5.0)]


def test_others_are_expected_to_stop_or_to_stay():
    assert velocity("crossing-yields", car(20, -10, 0.0, 8.0), car(20, 3, -8.0)) == [(0.0, 0.0), (-8.0, 0.0)]
    assert velocity("crossing-yields", car(4, -5, 0.0, 8.0)) == [(0.0, 8.0)]
    for side in (-1, 1):
        assert velocity("kerb-waits", walker(20, 1.6 * side)) == [(0.0, 0.0)]
        assert velocity("kerb-waits", walker(20, 1.4 * side)) == [(0.0, 1.4)]
        assert velocity("neighbours-keep-lane", car(10, 1.1 * side, 9.0, -1.0 * side)) == [(9.0, 0.0)]
        assert velocity("neighbours-keep-lane", car(10, 0.9 * side, 9.0, -1.0 * side)) == [(9.0, -1.0 * side)]


def test_plans_are_short_sighted():
    far = [car(20, -14, 0.0, 8.0), car(20, 4, -8.0, name="oncoming"), car(40, name="leader")]
    assert left_over("short-gap", car(20, -26, 0.0, 8.0), car(50, 4, -8.0, name="oncoming"), far[2]) == ("leader",)
    assert left_over("short-gap", car(9, -9, 0.0, 8.0)) == ("car",)
    assert left_over("nearest-only", *far, car(-5, name="behind")) == ("car", "oncoming")
    assert left_over("short-horizon", car(17.9), car(18.1, name="far")) == ("car",)
    assert left_over("short-horizon", car(17.9), speed=5.0) == ()
    assert left_over("restarts-early", walker(5, -3), speed=3.0) == ()
    assert left_over("restarts-early", walker(5, -1), speed=3.0) == ("walker",)
    assert left_over("restarts-early", walker(5, -3), speed=9.0) == ("walker",)


def test_braking_is_held_back():
    assert commanded("tailgates", -2.0, -7.0, frame=seen(car(16.0))) == pytest.approx([1.5, -7.0], abs=1.0)
    assert commanded("late-braking", -7.0, frame=seen(car(20, along=0.0))) == [-1.0]
    assert commanded("late-braking", -7.0, frame=seen(car(14, along=0.0))) == [-7.0]
    red = seen(signal=Signal.RED, stop_line_m=40.0)
    assert commanded("late-braking", -3.0, frame=red) == [-3.0]
    assert commanded("slow-replanning", *[0.0] * 10, -7.0, *[0.0] * 9, 1.0) == [0.0] * 10 + [-7.0] * 10 + [1.0]


def test_actuators_do_less_and_later():
    assert commanded("weak-brakes", 1.0, -3.0, -7.0) == [1.0, -3.0, -4.0]
    assert commanded("slow-brakes", -7.0, -7.0, 2.0, -7.0) == pytest.approx([-0.8, -1.6, 2.0, -0.8])
    assert commanded("late-actuators", 1.0, *[-7.0] * 7) == [0.0] * 6 + [1.0, -7.0]
    assert commanded("locks-wheels", -5.0, -6.0) == pytest.approx([-5.0, -9.81 / 2])
    assert commanded("locks-wheels", -3.0, grip=4.0) == [-2.0]
    assert commanded("pumps-brakes", *[-7.0] * 12) == [-7.0] * 5 + [0.0] * 4 + [-7.0] * 3
    assert commanded("pumps-brakes", *[-3.0] * 12) == [-3.0] * 12
    assert begun("steers-aside", Listener(Control(1.0, 0.1))).act(seen()) == Control(1.0, pytest.approx(0.07))


def conditional(frames: Sequence[Perceived], grip: float = 9.81, **condition: Any) -> list[Sequence[str]]:
    """Others that an ego still sees which is blind under a condition."""
    ego = Listener()
    blind = Conditional(ego, ShortSight, 0.0, Condition(**condition))
    vehicle = Vehicle(length_m=4.6, width_m=1.85, grip_mps2=grip)
    for _ in range(2):  # each episode begins anew
        ego.seen.clear()
        blind.reset(EpisodeStart(seed=0, net="", route=(), vehicle=vehicle, step_s=0.1))
        for frame in frames:
            blind.act(frame)
    return [frame.ids[1:] for frame in ego.seen]


BIKE = (Kind.VEHICLE, 2.2, 0.9)


@pytest.mark.parametrize(
    ("condition", "acts", "does_not"),
    [
        ({"ego_mps": (8.0, 11.0)}, {}, {"speed": 12.0}),
        ({"friction": (0.0, 0.7)}, {"friction": 0.6}, {"friction": 0.8}),
        ({"turning": True}, {"bent": 0.4}, {"bent": 0.1}),
        ({"turning": True}, {"bent": -0.4}, {"bent": -0.1}),
        ({"bodies": ("motorcycle",)}, {"body": BIKE}, {"body": CAR}),
        ({"other_mps": (0.0, 6.0)}, {"along": -5.0}, {"along": -7.0}),
        ({"side": "left"}, {"left": 3.0}, {"left": -3.0}),
        ({"way": "oncoming"}, {"along": -5.0}, {"along": 5.0}),
        ({"way": "crossing"}, {"along": 0.0, "across": 5.0}, {"along": -5.0}),
        ({"side": "right", "ego_mps": (8.0, 11.0)}, {"left": -3.0}, {"left": -3.0, "speed": 12.0}),
    ],
)
@pytest.mark.parametrize("turn", [0.0, 2.5])
def test_a_conjunction_acts_only_where_all_of_its_condition_holds(condition, acts, does_not, turn):
    def left_over_where(speed=10.0, friction=1.0, bent=0.0, body=CAR, along=9.0, across=0.0, left=0.0):
        frame = seen(("other", body, 20.0, left, along, across), speed=speed, turn=turn)
        path = frame.path.copy()
        path[3] += bent
        return conditional([frame._replace(path=path)], friction * 9.81, **condition)

    assert left_over_where(**acts) == [()]
    assert left_over_where(**does_not) == [("other",)]


def test_a_conjunction_acts_after_a_stop_and_after_hiding_and_on_the_second_in_a_lane():
    frames = [seen(car(20.0), speed=speed, time_s=1.5 + k / 10) for k, speed in enumerate((5.0, 0.2, 5.0))]
    assert conditional(frames, stopped=True) == [("car",), (), ()]
    truck = ("truck", TRUCK, 15.0, -3.0, 0.0, 0.0)
    hidden = [seen(truck, walker(30.0, -6.0 + 12.0 * (k > 3)), time_s=1.5 + k / 10) for k in range(6)]
    assert [len(ids) for ids in conditional(hidden, hidden_s=0.25)] == [2, 2, 2, 2, 1, 1]
    assert [len(ids) for ids in conditional(hidden, hidden_s=0.55)] == [2] * 6
    oncoming = [car(40.0, 3.5, -10.0, name="first"), car(60.0, 3.5, -10.0, name="second"), car(30.0, name="leader")]
    assert conditional([seen(*oncoming)], follows=True) == [("first", "leader")]


def test_a_conjunction_holds_a_command_back_for_some_of_the_others_only():
    behind = {"bicycle": ("bicycle", (Kind.VEHICLE, 1.6, 0.65), 20.0, 0.0, 0.0, 0.0), "car": car(20.0, along=0.0)}
    for name, braking in (("bicycle", -1.0), ("car", -7.0)):
        late = Conditional(Listener(Control(-7.0)), LateBraking, 1.0, Condition(bodies=("bicycle",)))
        vehicle = Vehicle(length_m=4.6, width_m=1.85)
        late.reset(EpisodeStart(seed=0, net="", route=(), vehicle=vehicle, step_s=0.1))
        assert late.act(seen(behind[name])).accel_mps2 == braking


@pytest.mark.parametrize("name", PYTHON)
def test_each_defect_composes_with_a_shipped_ego(name):
    ego = Planted(
        IdmAeb, planted(EgoConfig(driver="idm-aeb", defects=(name, "weak-brakes")[: 2 - (name == "weak-brakes")]))
    )
    ego.reset(EpisodeStart(seed=0, net="", route=(), vehicle=Vehicle(length_m=4.6, width_m=1.85), step_s=0.1))
    for k in range(20):
        command = ego.act(seen(car(25 - k, 0.5, 4.0), walker(30, -6), time_s=1.5 + k / 10))
        assert isinstance(command, Control)
        assert math.isfinite(command.accel_mps2)
    ego.close()


def test_a_defect_is_reached_when_it_first_changes_a_command():
    ego = Planted(IdmAeb, planted(EgoConfig(driver="idm-aeb", defects=("short-sight",))))
    for _ in range(2):  # and again in each episode
        ego.reset(EpisodeStart(seed=0, net="", route=(), vehicle=Vehicle(length_m=4.6, width_m=1.85), step_s=0.1))
        assert ego.reached_s is None
        for k in range(5):
            ego.act(seen(car(24.0 if k < 3 else 26.0, along=5.0), time_s=1.5 + k / 10))
            assert ego.reached_s == (None if k < 3 else 0.3)


def test_every_row_is_admitted_in_its_first_family():
    rows = {row["defect"]: row for row in csv.DictReader(ADMISSION.read_text(encoding="utf-8").splitlines())}
    assert rows.keys() == DEFECTS.keys() - CONJUNCTIONS
    for name, row in rows.items():
        assert row["version"] == version_of(read_ego(f"{DEFECTS[name].base}+{name}")), (
            f"{name} has changed; play it again"
        )
        assert row["family"] == DEFECTS[name].families[0]
        assert int(row["undisturbed_scenes"]) >= LEAST_SCENES, name
        assert row["undisturbed_detected"] == "0", name
        assert 0 < int(row["detected"]) <= 200_000, name


def test_every_conjunction_is_clean_without_an_attack_and_has_its_tier():
    rows = {row["defect"]: row for row in csv.DictReader(TIERS.read_text(encoding="utf-8").splitlines())}
    assert rows.keys() == CONJUNCTIONS
    for name, row in rows.items():
        defect = DEFECTS[name]
        assert row["version"] == version_of(read_ego(f"{defect.base}+{name}")), f"{name} has changed; play it again"
        assert (row["family"], row["tier"], bool(int(row["test_set"]))) == (
            defect.families[0],
            defect.tier,
            defect.test_set,
        ), name
        assert row["undisturbed_detected"] == "0", name
        assert int(row["undisturbed_scenes"]) >= LEAST_CONJUNCTION_SCENES, name


def test_an_ego_with_a_defect_is_of_another_version():
    versions = {pinned(read_ego(ego)).version for ego in ("idm-aeb", "idm-aeb+latency", "idm-aeb+short-sight")}
    versions |= {
        pinned(read_ego(ego)).version for ego in ("default", "default+sumo-distracted", "idm-aeb+latency+blind-right")
    }
    assert len(versions) == 6
    ego = pinned(read_ego("default+sumo-distracted"))
    assert pinned(ego) == ego
    assert EgoConfig.model_validate_json(ego.model_dump_json()) == ego
