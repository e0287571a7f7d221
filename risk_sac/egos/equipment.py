"""Sensors and actuators between an ego and the world: what they perceive wrongly, and what becomes of a command.

Errors are drawn from the episode's seed for each body by itself, so that they do not depend on which other bodies are
perceived. An ego, the same ego with defects, and its twin in a replay have the same errors.
"""

import hashlib
import math
import zlib
from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from risk_sac.config import EgoConfig
from risk_sac.config.ego import ActuatorConfig, BodyErrors, SensorErrors
from risk_sac.egos.seam import Control, Perceived, Vehicle
from risk_sac.world.types import SPEED, VX, VY, Floats, Kind, X, Y

HASH_DIGITS = 12
STREAM = 0x5E4503  # keeps these draws apart from the ego's own, which have the same seed


def version_of_equipment(ego: EgoConfig) -> str:
    """Returns a hash of an ego's sensors and actuators and of this code; empty without any."""
    parts = [each.model_dump_json().encode() if each else b"" for each in (ego.sensor_errors, ego.actuator_config)]
    if not any(parts):
        return ""
    return hashlib.sha256(b"\0".join([*parts, Path(__file__).read_bytes()])).hexdigest()[:HASH_DIGITS]


class BodyTrack:
    """The errors of one body over an episode: a first-order autoregression, and spells in which it is missed."""

    def __init__(self, seed: int, id_: str) -> None:
        self._rng = np.random.default_rng([STREAM, seed, zlib.crc32(id_.encode())])
        self._step = 0
        self._errors = self._rng.standard_normal(4)
        self._chance = self._rng.random()
        self._missed: bool | None = None

    def at(self, step: int, keeps: float, begins: float, ends: float) -> tuple[Floats, bool]:
        """Returns the errors at a step, in standard deviations, and whether the body is missed.

        Args:
          step: since the ego took over; never before that of the call before.
          keeps: correlation of errors from step to step.
          begins: probability that a spell in which it is missed begins in a step.
          ends: probability that it ends in a step.
        """
        if self._missed is None:
            self._missed = self._chance < begins / max(begins + ends, 1e-12)
        while self._step < step:
            self._step += 1
            self._errors = keeps * self._errors + math.sqrt(1.0 - keeps * keeps) * self._rng.standard_normal(4)
            chance = self._rng.random()
            self._missed = chance >= ends if self._missed else chance < begins
        return self._errors, self._missed


class Sensing:
    """What the ego perceives of the others, with the errors of its sensors."""

    def __init__(self, errors: SensorErrors) -> None:
        self._errors = errors
        self._of_kind: Mapping[int, BodyErrors] = {
            int(Kind.VEHICLE): errors.vehicles,
            int(Kind.PEDESTRIAN): errors.pedestrians,
        }

    def begin(self, seed: int, step_s: float) -> None:
        """Begins an episode."""
        e = self._errors
        self._seed, self._frame = seed, -1
        self._keeps = math.exp(-step_s / e.correlation_s) if e.correlation_s else 0.0
        self._ends = min(step_s / e.missed_for_s, 1.0)
        self._tracks: dict[str, BodyTrack] = {}
        self._past: deque[Perceived] = deque(maxlen=round(e.delay_s / step_s) + 1)

    def perceive(self, p: Perceived) -> Perceived:
        """Returns what the sensors tell; the ego's own motion is exact and of now."""
        self._frame += 1
        self._past.append(self._measured(p))
        then = self._past[0]
        return p._replace(ids=then.ids, kind=then.kind, state=np.hstack((p.state[:, :1], then.state[:, 1:])))

    def _measured(self, p: Perceived) -> Perceived:
        state, columns = p.state.copy(), [0]
        for i in range(1, len(p.ids)):
            body = self._of_kind[int(p.kind[i])]
            begins = min(body.missed / (1.0 - body.missed) * self._ends, 1.0)
            if p.ids[i] not in self._tracks:
                self._tracks[p.ids[i]] = BodyTrack(self._seed, p.ids[i])
            errors, missed = self._tracks[p.ids[i]].at(self._frame, self._keeps, begins, self._ends)
            if not missed and _measure(state, i, body, errors):
                columns.append(i)
        return p._replace(ids=tuple(p.ids[i] for i in columns), kind=p.kind[columns], state=state[:, columns])


def _measure(state: Floats, column: int, body: BodyErrors, errors: Floats) -> bool:
    """Adds errors to a column of a state; False where the body is out of range."""
    x, y = state[X, column] - state[X, 0], state[Y, column] - state[Y, 0]
    distance = math.hypot(x, y)
    if distance > body.range_m:
        return False
    cos, sin = (x / distance, y / distance) if distance else (1.0, 0.0)
    spread_m = math.hypot(body.distance_m, body.distance_share_at_100_m * distance * distance / 100.0)
    farther_m, aside_m = max(spread_m * errors[0], -distance), distance * body.azimuth_rad * errors[1]
    state[X, column] += farther_m * cos - aside_m * sin
    state[Y, column] += farther_m * sin + aside_m * cos
    along, across = body.speed_mps * errors[2], body.cross_speed_mps * errors[3]
    state[VX, column] += along * cos - across * sin
    state[VY, column] += along * sin + across * cos
    state[SPEED, column] = math.hypot(state[VX, column], state[VY, column])
    return True


class Actuation:
    """Dead time, then first-order lag, between a command and the wheels."""

    def __init__(self, config: ActuatorConfig) -> None:
        self._config = config

    def begin(self, accel_mps2: float, steering_rad: float, step_s: float) -> None:
        """Begins an episode with what the car does."""
        c = self._config
        delays = (c.delay_s, accel_mps2), (c.steering_delay_s, steering_rad)
        self._waiting = [deque([now] * round(delay_s / step_s)) for delay_s, now in delays]
        self._now = [accel_mps2, steering_rad]
        self._follows = [1.0 - math.exp(-step_s / lag_s) if lag_s else 1.0 for lag_s in (c.lag_s, c.steering_lag_s)]

    def act(self, control: Control) -> Control:
        """Returns the control that reaches the car in this step."""
        for i, wanted in enumerate(control):
            self._waiting[i].append(wanted)
            self._now[i] += self._follows[i] * (self._waiting[i].popleft() - self._now[i])
        return Control(*self._now)


def limited(vehicle: Vehicle, actuators: ActuatorConfig | None) -> Vehicle:
    """Returns the car with the actuators' limits; its ego knows these, but no lags."""
    limits = (
        {} if actuators is None else actuators.model_dump(include={"accel_mps2", "brake_mps2", "steering_rate_rad_s"})
    )
    lower = {name: min(value, getattr(vehicle, name)) for name, value in limits.items() if value is not None}
    return replace(vehicle, **lower)
