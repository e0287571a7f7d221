"""Sensors err as set, actuators lag, and both belong to ego versions."""

import math
import re
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from risk_sac.config import EgoConfig, field_errors
from risk_sac.config.ego import ActuatorConfig, BodyErrors, SensorErrors
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.equipment import Actuation, Sensing, limited
from risk_sac.egos.registry import pinned
from risk_sac.egos.seam import Control, Perceived, Vehicle
from risk_sac.errors import ConfigError
from risk_sac.world.types import SPEED, VX, VY, Floats, X, Y
from tests.unit.egos.test_defects import CAR, Actor, seen, walker

FRAMES = 4000
FAR: Actor = ("far", CAR, 60.0, 80.0, 3.0, 0.0)  # 100 m away, at a bearing of 53°


def sensed(errors: SensorErrors, *frames: Perceived, seed: int = 0) -> list[Perceived]:
    sensing = Sensing(errors)
    sensing.begin(seed, 0.1)
    return [sensing.perceive(frame) for frame in frames]


def measured(errors: SensorErrors, *actors: Actor) -> Floats:
    """Rows of the first actor's state, a column per frame."""
    return np.array([p.state[:, 1] for p in sensed(errors, *[seen(*actors)] * FRAMES)]).T


def test_errors_have_the_deviations_of_their_body_along_and_across_the_line_of_sight():
    body = BodyErrors(
        distance_m=3.0, distance_share_at_100_m=0.04, azimuth_rad=0.02, speed_mps=0.5, cross_speed_mps=2.0
    )
    state = measured(SensorErrors(vehicles=body, correlation_s=0.0), FAR)
    x, y, vx, vy = state[X] - 60.0, state[Y] - 80.0, state[VX] - 3.0, state[VY]
    spread = [np.std(along) for along in (0.6 * x + 0.8 * y, 0.6 * y - 0.8 * x)]
    assert spread == pytest.approx([5.0, 2.0], rel=0.05)  # √(3² + 4²) m, and 0.02 rad at 100 m
    assert [np.std(0.6 * vx + 0.8 * vy), np.std(0.6 * vy - 0.8 * vx)] == pytest.approx([0.5, 2.0], rel=0.05)
    np.testing.assert_allclose(state[SPEED], np.hypot(state[VX], state[VY]))
    exact = measured(SensorErrors(pedestrians=body), FAR)
    assert (exact[X] == 60.0).all()


def test_an_error_falls_to_1_e_within_the_correlation_time():
    x = measured(SensorErrors(vehicles=BodyErrors(distance_m=1.0), correlation_s=0.5), FAR)[X] - 60.0
    assert np.corrcoef(x[:-5], x[5:])[0, 1] == pytest.approx(math.exp(-1.0), abs=0.08)


def test_a_body_is_missed_for_its_share_of_the_time_in_spells_of_the_mean_length():
    errors = SensorErrors(vehicles=BodyErrors(missed=0.2), missed_for_s=0.5)
    missed = np.array(["far" not in p.ids for p in sensed(errors, *[seen(FAR)] * FRAMES)])
    assert missed.mean() == pytest.approx(0.2, abs=0.06)
    spells = np.count_nonzero(np.diff(missed.astype(int)) == 1)
    assert missed.sum() / spells * 0.1 == pytest.approx(0.5, abs=0.12)


def test_range_goes_by_body_and_delay_leaves_the_own_motion():
    errors = SensorErrors(pedestrians=BodyErrors(range_m=30.0), delay_s=0.2)
    frames = [seen(FAR, walker(x, 0.0), speed=x) for x in (40.0, 29.0, 28.0, 27.0)]
    found = sensed(errors, *frames)
    assert [p.ids[1:] for p in found] == [("far",)] * 3 + [("far", "walker")]
    assert [p.state[SPEED, 0] for p in found] == [40.0, 29.0, 28.0, 27.0]
    assert found[3].state[X, 2] == 29.0


def test_errors_go_by_the_seed_and_not_by_the_other_bodies():
    errors = SensorErrors(vehicles=BodyErrors(distance_m=1.0, missed=0.1))
    alone = sensed(errors, *[seen(FAR)] * 20)
    both = sensed(errors, *[seen(("near", CAR, 10.0, 0.0, 0.0, 0.0), FAR)] * 20)
    late = sensed(errors, *[seen()] * 10, *[seen(FAR)] * 10)

    def place(p: Perceived) -> float | None:
        return float(p.state[X, p.ids.index("far")]) if "far" in p.ids else None

    assert [place(p) for p in both] == [place(p) for p in alone]
    assert [place(p) for p in late[10:]] == [place(p) for p in alone[10:]]
    assert [place(p) for p in sensed(errors, *[seen(FAR)] * 20, seed=1)] != [place(p) for p in alone]


def test_a_command_arrives_after_the_dead_time_with_a_first_order_lag():
    actuation = Actuation(ActuatorConfig(delay_s=0.2, lag_s=0.1, steering_lag_s=0.2))
    actuation.begin(0.0, 0.1, 0.1)
    told = [actuation.act(Control(-8.0, -0.1)) for _ in range(4)]
    first, second = -8.0 * (1 - math.exp(-1)), -8.0 * (1 - math.exp(-2))
    assert [each.accel_mps2 for each in told] == pytest.approx([0.0, 0.0, first, second])
    assert told[0].steering_rad == pytest.approx(-0.1 + 0.2 * math.exp(-0.5))


def test_limits_only_lower_those_of_the_car():
    car = Vehicle(length_m=4.6, width_m=1.85)
    lower = limited(car, ActuatorConfig(brake_mps2=5.0, accel_mps2=20.0))
    assert (lower.brake_mps2, lower.accel_mps2) == (5.0, car.accel_mps2)
    assert limited(car, None) == car


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"driver": "r157", "sensors": "radr"}, r"sensors: got .radr.*radar, camera.*did you mean radar\?"),
        ({"driver": "r157", "sensors": {"vehicles": {"missed": -0.1}}}, r"sensors\.vehicles\.missed: got -0\.1.*>= 0"),
        ({"driver": "r157", "sensors": {"delay_s": 5}}, r"sensors\.delay_s: got 5.*<= 1"),
        ({"driver": "r157", "sensors": {"delay_s": 0.05}}, r"sensors\.delay_s: got 0\.05.*a multiple of the 0\.1 s"),
        ({"driver": "r157", "sensors": {"delays": 0.1}}, r"sensors\.delays: got 0\.1.*delay_s"),
        ({"driver": "r157", "actuators": {"brake_mps2": -5}}, r"actuators\.brake_mps2: got -5"),
        ({"driver": "r157", "actuators": 3}, r"actuators: got 3.*an object, or one of by-wire"),
        ({"sensors": "radar"}, r"sensors: got sensors of SUMO's driver.*name a driver"),
    ],
)
def test_bad_equipment_is_one_line(fields: dict[str, Any], line: str):
    with pytest.raises(ValidationError) as refused:
        EgoConfig.model_validate(fields)
    error = field_errors(refused.value, EgoConfig)
    assert re.match(line, str(error))
    assert error.others == ()


def test_the_command_line_names_presets_after_the_ego():
    ego = read_ego("idm-aeb+latency@slow-brakes@radar")
    assert (ego.driver, ego.defects, ego.sensors, ego.actuators) == ("idm-aeb", ("latency",), "radar", "slow-brakes")
    assert read_ego(ego.name) == ego
    own = EgoConfig(driver="r157", sensors=SensorErrors(delay_s=0.3))
    assert own.name == "r157@own-sensors"
    assert EgoConfig.model_validate_json(own.model_dump_json()) == own
    for text, line in {"r157@radar@camera": "@camera beside @radar", "r157@sonar": "@sonar"}.items():
        with pytest.raises(ConfigError, match=line):
            read_ego(text)


def test_equipment_is_a_part_of_the_version():
    names = ("r157", "r157@radar", "r157@camera", "r157@by-wire", "r157@radar@by-wire", "r157+latency@radar")
    assert len({pinned(read_ego(name)).version for name in names}) == 6
    ego = pinned(read_ego("r157@radar"))
    with pytest.raises(ConfigError, match=r"ego\.version"):
        pinned(ego.model_copy(update={"sensors": "camera"}))
