"""The vehicle under test: its driver and its sight."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from risk_sac.config.base import Settings, is_none
from risk_sac.config.equipment import (
    ACTUATOR_PRESETS,
    SENSOR_PRESETS,
    ActuatorChoice,
    ActuatorConfig,
    SensorErrors,
    Sensors,
)
from risk_sac.errors import ConfigError

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
    """SUMO's default driver with a driver's delay and view, or a driver that the operator has registered.

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
