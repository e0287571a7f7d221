import math

import numpy as np
import pytest

from risk_sac.config import SensorConfig
from risk_sac.sim.ego import MOTION, Belief, Perception, sight
from risk_sac.world.geometry import Sight
from risk_sac.world.types import Frame, X, Y
from tests.builders import moved
from tests.unit.sim.contacts import CAR, WALKER, ego, frames

WALKING = (20.0, -3.0, math.pi / 2, 0.0, 1.4, WALKER)
PARKED = (30.0, 3.0, 0.0, 0.0, 0.0, CAR)
IDS = ("ego", "walker", "parked")
WITHIN_100_M = Sight(reach_m=100.0, half_view_rad=math.pi, occlusion=False)


def frame_at(time_s: float) -> Frame:
    """The walker has walked since 0 s."""
    _, frame = frames(ego(), WALKING, PARKED, share=1.0)
    y = frame.y_m + 1.4 * time_s * np.array([0, 1, 0])
    return moved(frame._replace(time_s=time_s, ids=IDS), y_m=y)


def beyond_reach(frame: Frame, *unseen: str) -> Frame:
    """The frame with some of its actors where no sensor sees them."""
    return moved(frame, x_m=np.where([id_ in unseen for id_ in frame.ids], 1000.0, frame.x_m))


def look(perception: Perception, time_s: float, *seen: str) -> Belief:
    return perception.look(beyond_reach(frame_at(time_s), *{"walker", "parked"}.difference(seen)))


def hidden(belief: Belief) -> set[str]:
    return {id_ for id_, known in zip(IDS, belief.known, strict=True) if not known}


def expected(perception: Perception, belief: Belief) -> dict[str, list[float]]:
    """Position, heading and velocity of actors known but not seen."""
    columns = zip(IDS[1:], belief.known[1:], perception.seen, belief.state.T[1:], strict=True)
    return {id_: column[list(MOTION)].tolist() for id_, known, sees, column in columns if known and not sees}


def test_who_goes_out_of_sight_is_expected_to_go_on_until_memory_ends():
    perception = Perception(2.0, WITHIN_100_M)
    belief = look(perception, 1.0, "walker", "parked")
    assert hidden(belief) == set()
    assert expected(perception, belief) == {}
    belief = look(perception, 2.0, "parked")
    assert hidden(belief) == set()
    assert expected(perception, belief) == {"walker": pytest.approx([20.0, -3.0 + 1.4 * 2.0, math.pi / 2, 0.0, 1.4])}
    belief = look(perception, 3.0, "parked")
    assert expected(perception, belief)["walker"][1] == pytest.approx(-3.0 + 1.4 * 3.0)
    belief = look(perception, 3.1, "parked")
    assert hidden(belief) == {"walker"}
    assert expected(perception, belief) == {}


def test_what_is_expected_is_what_was_seen_last_and_not_what_is():
    perception = Perception(2.0, WITHIN_100_M)
    look(perception, 1.0, "walker", "parked")
    stopped = moved(frame_at(1.5), y_m=frame_at(1.0).y_m, vy_mps=0.0)
    belief = perception.look(beyond_reach(stopped, "walker"))
    assert expected(perception, belief)["walker"][1] == pytest.approx(-3.0 + 1.4 * 1.5)


def test_what_is_remembered_of_an_actor_stays_its_own_when_another_leaves():
    perception = Perception(3.0, WITHIN_100_M)
    look(perception, 1.0, "walker", "parked")
    frame = frame_at(2.0)
    without = frame._replace(ids=("ego", "parked"), kind=frame.kind[[0, 2]], state=frame.state[:, [0, 2]])
    belief = perception.look(beyond_reach(without, "parked"))
    assert belief.state[[X, Y], 1].tolist() == pytest.approx([30.0, 3.0])
    assert not perception.ever_seen("walker")
    assert perception.ever_seen("parked")


def test_a_flicker_is_no_break_and_more_is():
    perception = Perception(3.0, WITHIN_100_M)
    for tenth in range(10, 16):
        look(perception, tenth / 10, "walker")
    for tenth in range(16, 20):
        look(perception, tenth / 10)
    look(perception, 2.0, "walker")
    assert perception.in_view_for("walker", 2.0) == pytest.approx(1.0)
    for tenth in range(21, 27):
        look(perception, tenth / 10)
    assert perception.in_view_for("walker", 2.6) == 0.0
    look(perception, 2.7, "walker")
    assert perception.in_view_for("walker", 2.9) == pytest.approx(0.2)
    assert perception.ever_seen("walker")
    assert not perception.ever_seen("parked")


def test_a_look_takes_note_of_whom_the_sensor_sees():
    near = Perception(0.0, sight(SensorConfig(range_m=25.0), visibility_m=math.inf))
    assert hidden(near.look(frame_at(0.0))) == {"parked"}
    assert near.ever_seen("walker")
    assert hidden(Perception(0.0, sight(SensorConfig(), visibility_m=15.0)).look(frame_at(0.0))) == {"walker", "parked"}
    assert hidden(Perception(0.0, sight(None, visibility_m=math.inf)).look(frame_at(0.0))) == set()
    assert hidden(Perception(0.0, sight(None, visibility_m=15.0)).look(frame_at(0.0))) == {"walker", "parked"}


def test_at_night_a_pedestrian_is_seen_in_the_low_beam_only_and_a_vehicle_by_its_lights():
    day, night = (Perception(0.0, sight(None, math.inf, unlit_m)) for unlit_m in (math.inf, 15.0))
    assert hidden(day.look(frame_at(0.0))) == set()
    assert hidden(night.look(frame_at(0.0))) == {"walker"}
