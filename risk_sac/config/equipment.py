"""Errors of an ego's sensors, delays and limits of its actuators, and named sets of both."""

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from risk_sac.config.base import Settings, field_errors, shown
from risk_sac.errors import ConfigError, did_you_mean

STEP_S = 0.1  # of the simulation
SensorPreset = Literal["radar", "camera", "radar-camera"]
ActuatorPreset = Literal["by-wire", "slow-brakes"]


def _whole_steps(field: str, time_s: float) -> None:
    if abs(time_s / STEP_S - round(time_s / STEP_S)) > 1e-9:
        raise ConfigError(field, f"{time_s:g}", f"a multiple of the {STEP_S:g} s simulation step")


class BodyErrors(Settings):
    """Errors of a body's measurement, as standard deviations, and what is missed."""

    range_m: Annotated[float, Field(ge=1, le=1000)] = 1000.0
    """Distance between centres beyond which such a body is not perceived, m."""
    distance_m: Annotated[float, Field(ge=0, le=20)] = 0.0
    """Of the distance, m; the same at every distance."""
    distance_share_at_100_m: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Of the distance, as a share of it at 100 m; the share grows in proportion to the distance, as a camera's does."""
    azimuth_rad: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Of the direction, rad."""
    speed_mps: Annotated[float, Field(ge=0, le=20)] = 0.0
    """Of the velocity along the line of sight, m/s."""
    cross_speed_mps: Annotated[float, Field(ge=0, le=20)] = 0.0
    """Of the velocity across the line of sight, m/s."""
    missed: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    """Share of the time in which a body within range is not perceived."""


class SensorErrors(Settings):
    """Errors of sensors; the ego knows its own motion and the signals exactly."""

    vehicles: BodyErrors = BodyErrors()
    pedestrians: BodyErrors = BodyErrors()
    missed_for_s: Annotated[float, Field(ge=0.1, le=10)] = 0.2
    """Mean time for which a body is missed, s."""
    correlation_s: Annotated[float, Field(ge=0, le=60)] = 0.5
    """Time within which an error of a body falls to 1/e, s; 0: each step has an error of its own."""
    delay_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Age of what is perceived of others, s; a multiple of 0.1."""

    @model_validator(mode="after")
    def _in_steps(self) -> "SensorErrors":
        _whole_steps("delay_s", self.delay_s)
        return self


class ActuatorConfig(Settings):
    """Delays and lags between a command and the car, and limits below the car's own."""

    delay_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Dead time of acceleration and braking, s; a multiple of 0.1."""
    lag_s: Annotated[float, Field(ge=0, le=2)] = 0.0
    """Time constant of acceleration and braking, a first-order lag, s."""
    steering_delay_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Dead time of the steering, s; a multiple of 0.1."""
    steering_lag_s: Annotated[float, Field(ge=0, le=2)] = 0.0
    """Time constant of the steering, s."""
    accel_mps2: Annotated[float | None, Field(ge=0.5, le=20)] = None
    """The most the car speeds up, m/s²; null: the car's own."""
    brake_mps2: Annotated[float | None, Field(ge=1, le=20)] = None
    """The hardest the car brakes, m/s²; null: the car's own."""
    steering_rate_rad_s: Annotated[float | None, Field(ge=0.01, le=10)] = None
    """The fastest the front wheels turn, rad/s; null: the car's own."""

    @model_validator(mode="after")
    def _in_steps(self) -> "ActuatorConfig":
        _whole_steps("delay_s", self.delay_s)
        _whole_steps("steering_delay_s", self.steering_delay_s)
        return self


def _radar(**changes: float) -> BodyErrors:
    return BodyErrors(**{"distance_m": 0.4, "azimuth_rad": 0.005, "speed_mps": 0.12, "missed": 0.1} | changes)


SENSOR_PRESETS: Mapping[str, SensorErrors] = {
    "radar": SensorErrors(
        vehicles=_radar(cross_speed_mps=1.0), pedestrians=_radar(cross_speed_mps=1.0, range_m=50), delay_s=0.1
    ),
    "camera": SensorErrors(
        vehicles=BodyErrors(distance_share_at_100_m=0.11, speed_mps=0.3, cross_speed_mps=0.3, missed=0.02),
        pedestrians=BodyErrors(
            range_m=60, distance_share_at_100_m=0.11, speed_mps=0.3, cross_speed_mps=0.3, missed=0.02
        ),
        delay_s=0.2,
    ),
    "radar-camera": SensorErrors(
        vehicles=_radar(azimuth_rad=0.002, cross_speed_mps=0.3, missed=0.01),
        pedestrians=_radar(azimuth_rad=0.002, cross_speed_mps=0.3, missed=0.02, range_m=60),
        delay_s=0.2,
    ),
}
"""Named errors of sensors.

Radar: distance ±0.4 m, direction ±0.3°, velocity ±0.12 m/s and 10 % missed are the ends of the ranges of a typical
long-range radar, taken as standard deviations. Source: 3GPP TR 22.837, table of automotive radar KPIs.
Camera: distance ±5 % at 45 m and ±10 % at 90 m. Source: Stein, Mano, Shashua 2003, "Vision-based ACC with a single
camera: bounds on range and range rate accuracy". Velocity: about 0.3 m/s, the error that BEVDet4D reports on nuScenes.
Choice: all else; `radar-camera` has the radar's distance and the camera's direction.
"""

ACTUATOR_PRESETS: Mapping[str, ActuatorConfig] = {
    "by-wire": ActuatorConfig(delay_s=0.1, lag_s=0.1, steering_delay_s=0.2, steering_lag_s=0.27),
    "slow-brakes": ActuatorConfig(delay_s=0.2, lag_s=0.3, brake_mps2=5.0),
}
"""Named actuators.

By-wire: source: Autoware, sample_vehicle_launch, `simulator_model.param.yaml`: dead times of 0.1 s and 0.24 s (here
0.2), time constants of 0.1 s and 0.27 s. Choice: `slow-brakes`; 5 m/s² is the least that UN R152 demands.
"""

T = TypeVar("T", SensorErrors, ActuatorConfig)


def _reader(presets: Mapping[str, T], model: type[T]) -> Callable[[Any], Any]:
    """Returns a validator that refuses a preset or an object in one line."""

    def read(value: Any) -> Any:
        if not isinstance(value, dict | model) and (not isinstance(value, str) or value not in presets):
            expected = f"an object, or one of {', '.join(presets)}"
            raise ConfigError("", shown(value), expected, did_you_mean(str(value), presets))
        if isinstance(value, dict):
            try:
                return model.model_validate(value, strict=True)
            except ValidationError as error:
                raise field_errors(error, model) from error
        return value

    return read


Sensors = Annotated[SensorErrors | SensorPreset, BeforeValidator(_reader(SENSOR_PRESETS, SensorErrors))]
ActuatorChoice = Annotated[ActuatorConfig | ActuatorPreset, BeforeValidator(_reader(ACTUATOR_PRESETS, ActuatorConfig))]
