"""The vehicle under test: its driver, sight, sensors and actuators."""

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import BeforeValidator, Field, StringConstraints, ValidationError, model_validator

from risk_sac.config.base import Settings, field_errors, is_none, shown
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
    """Errors of sensors; the ego knows its own motion and signals exactly."""

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
    """Delays and lags from command to car, and limits below its own."""

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
    """Returns a validator of presets or objects, with errors in one line."""

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

CarFollowing = Literal["Krauss", "IDM", "EIDM", "ACC", "CACC"]
EgoName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_-]{0,39}$")]
MOST_DEFECTS = 10


class SensorConfig(Settings):
    """Line-of-sight sensor, mounted at the middle of the ego's roof."""

    range_m: Annotated[float, Field(ge=1, le=100_000)] = 80.0
    """Farthest distance at which a body is seen, m."""
    field_of_view_rad: Annotated[float, Field(ge=0.01, le=math.tau)] = math.tau
    """Opening angle centred on the ego's heading, rad."""
    occlusion: bool = True
    """Whether vehicles hide what stands behind them."""
    memory_s: Annotated[float, Field(ge=0, le=60)] = 3.0
    """How long an actor that went out of sight is still reckoned with, s; it is expected to go on as it did then."""


class EgoConfig(Settings):
    """SUMO's default driver with delay and limited view, or a registered driver.

    The profile `perfect` reacts within one simulation step and sees everything; `careful` adds the braking of UN
    R157's driver, `defensive` what the reference driver of that name does. A registered driver takes over at the
    adversaries' release and has the same view.
    """

    profile: Literal["default", "perfect", "careful", "defensive"] = "default"
    car_following: CarFollowing = "Krauss"
    reaction_time_s: Annotated[float, Field(ge=0.1, le=3.0)] = 0.5
    """Time between two decisions (SUMO's actionStepLength), s; a multiple of 0.1."""
    sensor: SensorConfig | None = SensorConfig()
    """None: the ego sees everything."""
    driver: EgoName | None = None
    """Name of a registered ego, as `GET /v1/egos` lists them; null: SUMO's models drive."""
    version: Annotated[str | None, Field(min_length=1, max_length=100)] = None
    """Of the registered ego and its defects. It is filled in where a campaign is posted; a run refuses to go on with
    another one."""
    label: Annotated[str | None, Field(min_length=1, max_length=100, pattern=r"^\S+( \S+)*$")] = None
    """Version of the ego as its maker calls it, such as `1.4`; `GET /v1/egos/{name}/trend` compares versions."""
    response_time_s: Annotated[float | None, Field(ge=0.0, le=5.0)] = None
    """Time within which the ego responds, s; its time-to-collision requirement follows from it. By default what a
    registered ego declares, or `reaction_time_s`."""
    defects: Annotated[tuple[EgoName, ...], Field(max_length=MOST_DEFECTS)] = ()
    """Known faults to plant into the ego, as `GET /v1/egos` lists them."""
    sensors: Sensors | None = Field(default=None, exclude_if=is_none)
    """Errors of what a registered ego perceives: a preset or an object; null: none."""
    actuators: ActuatorChoice | None = Field(default=None, exclude_if=is_none)
    """Delays and limits of what a registered ego commands: a preset or an object; null: the car's own."""

    @property
    def name(self) -> str:
        """The ego as a command line names it, such as `idm-aeb+latency@radar`."""
        equipment = (("sensors", self.sensors), ("actuators", self.actuators))
        chosen = [value if isinstance(value, str) else f"own-{field}" for field, value in equipment if value]
        return "@".join(("+".join((self.driver or self.profile, *self.defects)), *chosen))

    @property
    def sensor_errors(self) -> SensorErrors | None:
        """The errors that `sensors` stands for."""
        return SENSOR_PRESETS[self.sensors] if isinstance(self.sensors, str) else self.sensors

    @property
    def actuator_config(self) -> ActuatorConfig | None:
        """The delays and limits that `actuators` stands for."""
        return ACTUATOR_PRESETS[self.actuators] if isinstance(self.actuators, str) else self.actuators

    @property
    def response_s(self) -> float:
        """The response time that requirements go by."""
        return self.reaction_time_s if self.response_time_s is None else self.response_time_s

    @model_validator(mode="before")
    @classmethod
    def _apply_profile(cls, data: object) -> object:
        if not isinstance(data, dict):
            return data
        if isinstance(data.get("defects"), list):  # after this validator JSON's lists are no tuples any more
            data = {**data, "defects": tuple(data["defects"])}
        perfect = {"reaction_time_s": 0.1, "sensor": None} if data.get("profile") == "perfect" else {}
        return {**perfect, **data}

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if abs(self.reaction_time_s * 10 - round(self.reaction_time_s * 10)) > 1e-9:
            expected = "a multiple of the 0.1 s simulation step"
            raise ConfigError("reaction_time_s", f"{self.reaction_time_s:g}", expected)
        if self.profile == "perfect" and (self.reaction_time_s > 0.1 or self.sensor is not None):
            remedy = "leave reaction_time_s and sensor out"
            raise ConfigError("profile", "'perfect', which has no delay and no sensor", "'default'", remedy)
        if self.driver is None and not self.defects and self.version is not None:
            raise ConfigError("version", "a version without a driver", "that of a registered ego, which driver names")
        if len(set(self.defects)) < len(self.defects):
            raise ConfigError("defects", f"{list(self.defects)}", "each defect once")
        for field, value in (("sensors", self.sensors), ("actuators", self.actuators)):
            if value is not None and self.driver is None:
                got = f"{field} of SUMO's driver, which perceives and moves by SUMO's models"
                remedy = "name a driver such as idm-aeb, or plant a defect of the kind sumo"
                raise ConfigError(field, got, "a registered ego", remedy)
        models = (self.profile, self.car_following, self.reaction_time_s)
        if self.driver is not None and models != ("default", "Krauss", 0.5):
            got = "a driver beside profile, car_following or reaction_time_s, which SUMO's drivers have"
            raise ConfigError("driver", got, "either", "leave the others out")
        return self
