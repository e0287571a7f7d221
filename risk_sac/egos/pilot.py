"""Drives an ego: shows it what it perceives, and moves its car by its commands."""

import math
from functools import cache
from itertools import compress

import numpy as np

from risk_sac.egos.bicycle import advance, track
from risk_sac.egos.guard import Guarded
from risk_sac.egos.seam import Episode, Perceived, Trajectory, Vehicle
from risk_sac.jit import compiled
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.sim.ego import Belief
from risk_sac.sim.lanes import road_around, signals_at
from risk_sac.sim.paths import Along
from risk_sac.sim.pilot import Motion
from risk_sac.types import (
    ACCEL,
    HEADING,
    LATERAL,
    OFFSET,
    SPEED,
    STEP_S,
    VX,
    VY,
    Bools,
    Floats,
    Frame,
    Road,
    Signal,
    X,
    Y,
)

BRAKE_MPS2 = 9.0  # as SUMO's driver can, on dry asphalt


def perceive(frame: Frame, belief: Belief, along: Along, signals: tuple[Signal, ...]) -> Perceived:
    """Returns the actors of a frame that the ego knows of by its sensor and its memory."""
    known = belief.known
    path, station_m, offset_m = along
    return Perceived(
        time_s=frame.time_s,
        ids=tuple(compress(frame.ids, known.tolist())),
        kind=frame.kind[known],
        state=shown(belief.state, known),
        path=path,
        station_m=station_m,
        offset_m=offset_m,
        signal=frame.signal,
        stop_line_m=frame.stop_line_m,
        signals=signals,
    )


class EgoPilot:
    """Drives the ego of one episode after the other."""

    _vehicle: Vehicle
    _motion: Motion
    _road: Road

    def __init__(self, ego: Guarded) -> None:
        self._ego = ego
        self._net, self._road_around = "", cache(road_around)

    def begin(self, layout: Layout, seed: int, frame: Frame) -> Motion:
        """See `risk_sac.sim.pilot.Pilot.begin`."""
        grip = layout.friction * GRAVITY_MPS2
        length_m, width_m = float(frame.length_m[0]), float(frame.width_m[0])
        self._vehicle = Vehicle(length_m=length_m, width_m=width_m, brake_mps2=min(BRAKE_MPS2, grip), grip_mps2=grip)
        own = frame.state[[X, Y, HEADING, SPEED, ACCEL], 0].tolist()
        self._motion = Motion(*own)
        if layout.net != self._net:  # another one may use the same names
            self._net = layout.net
            self._road_around.cache_clear()
        route = layout.ego.route
        self._road = self._road_around(route)
        self._ego.reset(
            Episode(seed=seed, net=layout.net, route=route, vehicle=self._vehicle, step_s=STEP_S, road=self._road)
        )
        return self._motion

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        """See `risk_sac.sim.pilot.Pilot.drive`."""
        command = self._ego.act(perceive(frame, belief, along, signals_at(self._road.stop_lines)))
        if isinstance(command, Trajectory):
            command = track(command, self._motion, self._vehicle)
        self._motion = advance(self._motion, command.accel_mps2, command.steering_rad, self._vehicle, STEP_S)
        return self._motion

    @property
    def defect_reached_s(self) -> float | None:
        """See `Planted.reached_s`, of an ego that has defects."""
        return self._ego.defect_reached_s

    def close(self) -> None:
        """Closes the ego."""
        self._ego.close()


@compiled
def shown(state: Floats, known: Bools) -> Floats:
    """Returns the columns of known actors, with the rows that a sensor measures."""
    found = np.empty((state.shape[0], int(known.sum())))
    column = 0
    for i in range(state.shape[1]):
        if not known[i]:
            continue
        for row in range(state.shape[0]):
            found[row, column] = state[row, i]
        if i > 0:
            found[SPEED, column] = math.hypot(state[VX, i], state[VY, i])
            found[LATERAL, column] = found[ACCEL, column] = found[OFFSET, column] = np.nan
        column += 1
    return found
