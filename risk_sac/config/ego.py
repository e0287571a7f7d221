"""The vehicle under test: which SUMO models drive it and what it can see."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from risk_sac.config.base import Settings

CarFollowing = Literal["Krauss", "IDM", "EIDM", "ACC", "CACC"]


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
    """SUMO's default driver, with a driver's delay and a driver's view.

    The profile `perfect` reacts within one simulation step and sees everything. The profile `careful` is the default
    with the careful driver's braking on top, by whom preventable failures are judged.
    """

    profile: Literal["default", "perfect", "careful"] = "default"
    car_following: CarFollowing = "Krauss"
    reaction_time_s: Annotated[float, Field(ge=0.1, le=3.0)] = 0.5
    """Time between two decisions (SUMO's actionStepLength), s; a multiple of 0.1."""
    sensor: SensorConfig | None = SensorConfig()
    """None: the ego sees everything."""

    @model_validator(mode="before")
    @classmethod
    def _apply_profile(cls, data: object) -> object:
        if isinstance(data, dict) and data.get("profile") == "perfect":
            return {"reaction_time_s": 0.1, "sensor": None, **data}
        return data

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if abs(self.reaction_time_s * 10 - round(self.reaction_time_s * 10)) > 1e-9:
            raise ValueError(
                f"reaction_time_s is {self.reaction_time_s:g}; wanted a multiple of the 0.1 s simulation step"
            )
        if self.profile == "perfect" and (self.reaction_time_s > 0.1 or self.sensor is not None):
            raise ValueError(
                "profile 'perfect' has no delay and no sensor; leave reaction_time_s and sensor out, or use 'default'"
            )
        return self
