import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.env.observation_layout import PER_ADVERSARY, PER_STATIC, SPEED_MPS, X_M, Y_M
from risk_sac.search.scripts import SIZE, Act, Genes, Seen, act, adversaries_seen, cue
from risk_sac.verdicts.behaviour import pedal_changes

MIDDLE = Genes(*[0.5] * SIZE)
unit = st.floats(0, 1)
genes = st.builds(Genes, *[unit] * SIZE)
seen = st.builds(
    lambda time_s, x_m, y_m, turn, speed_mps, ego_mps: Seen(
        time_s, x_m, y_m, math.cos(turn), math.sin(turn), speed_mps, ego_mps
    ),
    st.floats(0, 15),
    st.floats(-200, 200),
    st.floats(-40, 40),
    st.floats(-math.pi, math.pi),
    st.floats(0, 20),
    st.floats(0, 20),
)


def beside(x_m: float = 8.0, y_m: float = 3.3, *, time_s: float = 2.0, speed_mps: float = 10.0) -> Seen:
    """A neighbour, at the ego's speed unless said otherwise."""
    return Seen(time_s, x_m, y_m, 1.0, 0.0, speed_mps, 10.0)


def mirrored(one: Seen) -> Seen:
    return one._replace(y_m=-one.y_m, sin=-one.sin)


@given(genes, seen, st.floats(-1, 15), st.booleans())
def test_every_action_is_one(script, one, since_cue_s, pedestrian):
    drive, steer = act(script, one, since_cue_s, pedestrian)
    assert -1 <= drive <= 1
    assert -1 <= steer <= 1


@given(genes, seen, st.floats(-1, 15))
def test_who_drives_the_egos_way_does_the_same_from_the_other_side(script, one, since_cue_s):
    along = one._replace(cos=1.0, sin=0.0)
    drive, steer = act(script, along, since_cue_s, pedestrian=False)
    assert act(script, mirrored(along), since_cue_s, pedestrian=False) == Act(drive, pytest.approx(-steer))


def test_a_neighbour_takes_up_its_place_and_then_comes_over():
    far = MIDDLE._replace(place=1.0, aside=0.0)
    assert act(far, beside(), -0.1, pedestrian=False) == Act(1.0, -1.0)  # up to 12 m ahead, and to the edge of its lane
    assert act(far, beside(12.0, 1.9), -0.1, pedestrian=False) == Act(0.0, 0.0)
    strike = MIDDLE._replace(drive=0.0, steer=0.7, after=1.0, lasts=0.25)
    assert act(strike, beside(), 0.5, pedestrian=False) == Act(-1.0, -0.7)
    assert act(strike, beside(), 1.5, pedestrian=False) == Act(1.0, 0.0)


@pytest.mark.parametrize("side", [1, -1])
def test_a_leader_leaves_late_before_a_standing_body_to_the_side_that_its_genes_say(side):
    hides = beside(25.0, 0.1 * side, speed_mps=20.0)._replace(ego_mps=20.0, standing_m=45.0)
    script = MIDDLE._replace(steer=0.5 + 0.4 * side, aside=1.0, cue=0.5, drive=0.6)
    assert cue(script, hides, pedestrian=False)  # 2.3 s from it
    assert not cue(script, hides._replace(standing_m=47.0), pedestrian=False)
    assert act(script, hides, 0.0, pedestrian=False) == Act(pytest.approx(0.5), side)
    aside = hides._replace(y_m=3.1 * side)  # where it stays
    assert act(script, aside, 1.0, pedestrian=False).steer == pytest.approx(0.0)
    assert act(script, hides, 2.1, pedestrian=False).steer == 0.0  # the strike is over
    stays = script._replace(steer=0.5 + 0.05 * side)
    assert act(stays, hides, 0.0, pedestrian=False).steer == pytest.approx(-0.1 * side)
    ordinary = hides._replace(standing_m=math.inf)
    assert act(script, ordinary, 0.0, pedestrian=False).steer * side < 0.0  # a leader keeps its lane


@pytest.mark.parametrize("side", [1, -1])
def test_a_neighbour_does_not_cut_in_before_a_standing_body(side):
    neighbour = beside(8.0, 2.8 * side)._replace(standing_m=30.0)
    strike = MIDDLE._replace(steer=0.5 - 0.5 * side, aside=1.0, lasts=1.0)  # towards the ego
    assert act(strike, neighbour, 0.5, pedestrian=False).steer * side > 0.0


@pytest.mark.parametrize("side", [1, -1])
def test_crossing_traffic_hurries_when_it_would_be_late_and_waits_when_early(side):
    late = Seen(0.0, 20.0, 40.0 * side, 0.0, -1.0 * side, 10.0, 10.0)  # 4 s from the ego's axis, the ego 2 s
    early = late._replace(y_m=10.0 * side)
    keen = MIDDLE._replace(aside=1.0)
    assert act(keen, late, -0.1, pedestrian=False).drive == 1.0
    assert act(keen, early, -0.1, pedestrian=False).drive == -1.0
    assert act(keen, late._replace(y_m=20.0 * side), -0.1, pedestrian=False).drive == 0.0
    assert act(keen._replace(aside=0.0), late, -0.1, pedestrian=False).drive == 0.4


@pytest.mark.parametrize("side", [1, -1])
def test_a_pedestrian_waits_for_the_ego_and_then_steps_out(side):
    far = Seen(3.0, 60.0, -5.0 * side, 0.0, 1.0 * side, 1.0, 10.0)
    near = far._replace(x_m=40.0)
    keen = MIDDLE._replace(aside=1.0, cue=0.2, drive=0.7)
    assert act(keen, far, -0.1, pedestrian=True).drive == -1.0
    assert act(keen, near, -0.1, pedestrian=True).drive == 1.0
    assert not cue(keen, far._replace(x_m=11.5), pedestrian=True)
    assert cue(keen, far._replace(x_m=10.5), pedestrian=True)
    assert act(keen, near, 0.0, pedestrian=True).drive == pytest.approx(0.4)


def test_the_observation_is_read_back_in_metres():
    observation = np.zeros(2 * PER_ADVERSARY + 1, np.float32)
    observation[:7] = 12 / X_M, -3 / Y_M, 0.1, 0.1, 0.6, -0.8, 9 / SPEED_MPS
    observation[-1] = 11 / SPEED_MPS
    first, gone = adversaries_seen(observation, 2, step=20)
    assert gone is None
    assert first == pytest.approx(Seen(2.0, 12.0, -3.0, 0.6, -0.8, 9.0, 11.0))


@pytest.mark.parametrize(
    ("ahead_m", "aside_m", "to_m"), [(70.0, 0.5, 58.0), (70.0, 5.0, math.inf), (9.0, 0.0, math.inf)]
)
def test_the_next_static_body_on_the_egos_way_is_read_from_the_observation(ahead_m, aside_m, to_m):
    observation = np.zeros(PER_ADVERSARY + 2 * PER_STATIC + 2, np.float32)
    observation[:7] = 12 / X_M, 0.0, 0.0, 0.0, 1.0, 0.0, 9 / SPEED_MPS
    observation[-5:-1] = ahead_m / X_M, aside_m / Y_M, 150.0 / X_M, 4.6 / Y_M  # the other stands in the next lane
    (leader,) = adversaries_seen(observation, 1, step=0, statics=2)
    assert leader is not None
    assert leader.standing_m == pytest.approx(to_m)


@pytest.mark.parametrize("side", [1, -1])
def test_a_vehicle_that_keeps_its_time_changes_pedals_no_more_than_a_driver(side):
    speed, accel, own_m, ego_m, ego_mps, held, acts = 3.0, 0.0, 25.0, 84.0, 12.0, [], [0.0, 0.0]
    for step in range(60):
        seen = Seen(step * 0.1, ego_m, own_m * side, 0.0, -1.0 * side, speed, ego_mps)
        acts.append(act(MIDDLE._replace(aside=1.0), seen, -0.1, pedestrian=False).drive)
        drive = acts[step]  # two steps later
        accel += np.clip(drive * (2.0 if drive > 0.0 else 4.0) - accel, -1.0, 1.0)  # 10 m/s³
        speed, ego_mps = speed + accel * 0.1, ego_mps - 0.12
        own_m, ego_m = own_m - speed * 0.1, ego_m - ego_mps * 0.1
        held.append(accel)
    assert own_m / speed == pytest.approx(ego_m / ego_mps, abs=1.0)
    assert pedal_changes(np.array(held), np.arange(60) * 0.1)[0] <= 1.0
