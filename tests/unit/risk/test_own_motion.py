import math
from collections.abc import Sequence
from contextlib import closing

import numpy as np
import pytest

from risk_sac.config import RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.maps.carriageway import carriageway_of
from risk_sac.risk.publish import HEADWAY_CAP_S, OwnMotion, OwnMotionGauge
from risk_sac.risk.requirements import SIGNALS
from risk_sac.world.types import Frame, Kind
from tests.builders import frame_of

EAST, NORTH, WEST = 0.0, math.pi / 2, math.pi
Pose = tuple[float, float, float]


def measured(net: str, *frames: Frame) -> list[OwnMotion]:
    gauge = OwnMotionGauge()
    gauge.reset(carriageway_of(f"{net}/{net}.net.xml"))
    return [gauge.measure(frame) for frame in frames]


def at(net: str, *poses: Pose, speed_mps: Sequence[float] | float = 10.0, kind: Sequence[Kind] | None = None):
    """Measures the ego, 4.6 m by 1.85 m, at the first pose."""
    x_m, y_m, heading_rad = zip(*poses, strict=True)
    speeds = np.broadcast_to(speed_mps, len(poses))
    return measured(net, frame_of(kind, x_m=x_m, y_m=y_m, heading_rad=heading_rad, speed_mps=speeds))[0]


@pytest.mark.parametrize(
    ("net", "pose", "offset_m", "edge_m", "carriageway_m"),
    [
        pytest.param("mixed", (500, -4.95, EAST), 0.0, 0.725, 2.575, id="straight lane"),
        pytest.param("mixed", (500, 4.95, WEST), 0.0, 0.725, 2.575, id="straight lane the other way"),
        pytest.param("mixed", (500, -3.5, EAST), 1.45, 2.175, 3.0, id="lane change"),
        pytest.param("mixed", (500, -6.4, EAST), 1.45, -0.725, 1.125, id="over the kerb"),
        pytest.param("mixed", (500, -8.025, EAST), 3.075, -2.35, -0.5, id="half a metre beside the road"),
        pytest.param("mixed", (500, 1.65, EAST), 3.3, -2.575, -0.725, id="on an oncoming lane"),
        pytest.param("mixed", (500, 300, EAST), 10.0, -10.0, -10.0, id="in a field"),
        pytest.param("low", (500, 0.0, EAST), 0.0, 4.025, 3.0, id="middle of three lanes"),
        pytest.param("low", (500, 0.0, WEST), 10.0, -10.0, -10.0, id="the wrong way of a one-way road"),
        pytest.param("dense", (6.45, 0, NORTH), 0.0, 5.0, 3.0, id="inside a junction"),
        pytest.param("dense", (6.45, -19.6, NORTH), 0.0, 0.725, 2.7, id="at its entry"),
        pytest.param("dense", (14, 14, NORTH), 6.02, -6.24, -1.81, id="on the corner of a junction"),
    ],
)
def test_where_an_ego_is(net, pose, offset_m, edge_m, carriageway_m):
    own = at(net, pose)
    assert own.lane_offset_m == pytest.approx(offset_m, abs=0.01)
    assert own.edge_m == pytest.approx(edge_m, abs=0.1)
    assert own.carriageway_m == pytest.approx(carriageway_m, abs=0.1)


def place(own: OwnMotion) -> tuple[float, ...]:
    return own.lane_offset_m, own.over_limit_mps, own.edge_m, own.carriageway_m


def test_places_are_alike_on_nets_that_are_alike_turned_or_mirrored():
    generator = np.random.default_rng(1)
    for x, y, turn in generator.uniform((-60, -12, -0.7), (60, 12, 0.7), (100, 3)):
        one = place(at("mixed", (500 + x, y, turn)))
        assert place(at("mixed", (500 - x, -y, turn + math.pi))) == pytest.approx(one, abs=2e-3)
        one = place(at("dense", (x, y, turn)))
        assert place(at("dense", (-y, x, turn + math.pi / 2))) == pytest.approx(one, abs=2e-3)
        one = place(at("low", (500 + x, y, turn)))
        assert place(at("low", (500 + x, -y, -turn))) == pytest.approx(one, abs=2e-3)


@pytest.mark.parametrize(
    ("others", "speeds", "overtakes"),
    [
        pytest.param([(510, -1.65, EAST)], [4.0], True, id="a slower one ahead in its lane"),
        pytest.param([(510, -1.65, EAST)], [0.0], True, id="one that stands"),
        pytest.param([(491, -1.65, EAST)], [4.0], True, id="one that it has just passed"),
        pytest.param([(510, -1.65, EAST)], [12.0], False, id="a faster one"),
        pytest.param([(540, -1.65, EAST)], [4.0], False, id="one far ahead"),
        pytest.param([(480, -1.65, EAST)], [4.0], False, id="one that it passed long ago"),
        pytest.param([(520, 4.95, WEST)], [4.0], False, id="one that comes towards it"),
        pytest.param([(510, -7.85, EAST)], [0.0], False, id="one that is parked on the sidewalk"),
    ],
)
def test_oncoming_lanes_count_only_while_the_ego_overtakes(others, speeds, overtakes):
    own = at("mixed", (500, 1.65, EAST), *others, speed_mps=[10.0, *speeds])
    assert (own.carriageway_m > 0) == (own.edge_m > 0) == overtakes
    assert own.lane_offset_m == pytest.approx(3.3)


def test_no_overtaking_makes_a_field_a_road():
    assert at("mixed", (500, -9, EAST), (510, -1.65, EAST), speed_mps=[10.0, 0.0]).carriageway_m < -1.0


@pytest.mark.parametrize(
    ("net", "pose", "speed_mps", "over_mps"),
    [
        ("mixed", (500, -4.95, EAST), 10.0, -3.89),
        ("mixed", (500, -4.95, EAST), 15.0, 1.11),
        ("low", (500, 0.0, EAST), 15.0, -1.67),
        pytest.param("dense", (7.36, -13.59, 1.2), 10.0, -3.89, id="a turn has the limit of the road that leads to it"),
        pytest.param("mixed", (500, -9.0, EAST), 15.0, 1.11, id="beside the road it is that of the road"),
        pytest.param("mixed", (500, 300, EAST), 15.0, -60.0, id="without a road there is none"),
    ],
)
def test_speed_over_the_limit(net, pose, speed_mps, over_mps):
    assert at(net, pose, speed_mps=speed_mps).over_limit_mps == pytest.approx(over_mps, abs=0.01)


def series(steps: int, speed_mps: float = 10.0, yaw_rad_s: float = 0.0, accel_mps2: Sequence[float] | None = None):
    accels = np.zeros(steps) if accel_mps2 is None else accel_mps2
    return measured(
        "low",
        *(
            frame_of(
                time_s=0.1 * i,
                x_m=[500.0],
                y_m=[0.0],
                heading_rad=yaw_rad_s * 0.1 * i,
                speed_mps=speed_mps,
                accel_mps2=a,
            )
            for i, a in enumerate(accels)
        ),
    )


def test_jerk_is_the_change_of_acceleration_over_three_steps():
    jerks = [own.ego_jerk_mps3 for own in series(8, accel_mps2=[0, 0, 0, 0, -3, -3, -3, -3])]
    assert jerks == pytest.approx([0, 0, 0, 0, 10, 10, 10, 0])


def test_how_an_episode_begins_is_no_motion():
    assert [own.ego_jerk_mps3 for own in series(3, accel_mps2=[0, -4.5, -4.5])] == [0, 0, 0]


@pytest.mark.parametrize("yaw_rad_s", [0.3, -0.3])
def test_lateral_acceleration_is_speed_times_yaw_rate_across_any_heading(yaw_rad_s):
    frames = series(30, speed_mps=8.0, yaw_rad_s=yaw_rad_s)  # past 180° on the way
    assert [own.ego_lateral_accel_mps2 for own in frames[3:]] == pytest.approx([2.4] * 27)


VEHICLE, PEDESTRIAN = Kind.VEHICLE, Kind.PEDESTRIAN


@pytest.mark.parametrize(
    ("pose", "kind", "headway_s"),
    [
        pytest.param((524.6, 0.0, 0.0), VEHICLE, 2.0, id="ahead"),
        pytest.param((524.6, 1.0, 0.0), VEHICLE, 2.0, id="a part of it ahead"),
        pytest.param((524.6, 3.3, 0.0), VEHICLE, HEADWAY_CAP_S, id="in the next lane"),
        pytest.param((475.4, 0.0, 0.0), VEHICLE, HEADWAY_CAP_S, id="behind"),
        pytest.param((524.6, 0.0, math.pi), VEHICLE, HEADWAY_CAP_S, id="oncoming"),
        pytest.param((524.6, 0.0, math.pi / 2), VEHICLE, HEADWAY_CAP_S, id="crossing"),
        pytest.param((524.6, 0.0, 0.0), PEDESTRIAN, HEADWAY_CAP_S, id="a pedestrian"),
        pytest.param((504.0, 0.0, 0.0), VEHICLE, 0.0, id="in contact"),
    ],
)
def test_headway_is_the_time_gap_to_the_vehicle_that_is_followed(pose, kind, headway_s):
    own = at("low", (500, 0, 0.0), pose, speed_mps=[10.0, 5.0], kind=[VEHICLE, kind])
    assert own.headway_s == pytest.approx(headway_s)


@pytest.mark.parametrize("side", [1, -1])
def test_headway_follows_the_bend(side):
    """The leader is 30 m ahead on the arc, another straight ahead."""
    radius_m, speed_mps, angle = 40.0, 10.0, side * 30.0 / 40.0
    leader = side * radius_m * math.sin(abs(angle)), side * radius_m * (1 - math.cos(angle))
    frames = []
    for i in range(4):
        turned = side * speed_mps * 0.1 * (i - 3) / radius_m
        frames.append(
            frame_of(
                time_s=0.1 * i,
                x_m=[0.0, abs(leader[0]), 20.0],
                y_m=[0.0, leader[1], 0.0],
                heading_rad=np.array([turned, angle, 0.0]),
                speed_mps=[speed_mps, 10.0, 10.0],
            )
        )
    assert measured("low", *frames)[-1].headway_s == pytest.approx((30.0 - 4.6) / speed_mps, abs=1e-6)


@pytest.mark.parametrize("family", ["low", "mixed", "dense"])
def test_sumos_driver_stays_on_the_carriageway_and_every_signal_in_its_range(family):
    lateral, offset = 0.0, 0.0
    with closing(RiskSacEnv.of(RunSpec(family=family, method="no-adversary", seed=0))) as env:
        which = env._gauge.names.index("on_carriageway")
        for seed in range(4):
            env.reset(seed=seed)
            while not any(env.step(np.zeros(env.action_size, dtype=np.float32))[2:4]):
                pass
            for m in env.trace.measures:
                assert all(SIGNALS[name].low <= value <= SIGNALS[name].high for name, value in m.signals.items())
                assert 0.75 <= m.robustness[which] <= 1.5
                lateral = max(lateral, m.signals["ego_lateral_accel_mps2"])
                offset = max(offset, m.signals["lane_offset_m"])
    assert lateral < 6.0  # SUMO turns with 5.5 m/s²
    assert offset < 1.7  # half a lane
