"""Drives an ego: shows it what it perceives, and moves its car by its commands."""

import math

import numpy as np
from numpy.typing import NDArray

from risk_sac.egos.bicycle import advance, track
from risk_sac.egos.guard import Guarded
from risk_sac.egos.seam import Episode, Perceived, Trajectory, Vehicle
from risk_sac.jit import compiled
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.sim.ego import Belief
from risk_sac.sim.paths import Along
from risk_sac.sim.pilot import Motion
from risk_sac.types import ACCEL, LATERAL, OFFSET, SPEED, STEP_S, VX, VY, Bools, Floats, Frame

BRAKE_MPS2 = 9.0  # as SUMO's driver can, on dry asphalt


class View:
    """Makes the ego's perception of a frame; one for each episode."""

    def __init__(self) -> None:
        self._of: tuple[tuple[str, ...], bytes] = ((), b"")
        self._ids: tuple[str, ...] = ()
        self._kind: NDArray[np.int8] = np.empty(0, dtype=np.int8)

    def perceived(self, frame: Frame, belief: Belief, along: Along) -> Perceived:
        """Returns the actors that it knows of by its sensor and its memory."""
        known = belief.known
        of = frame.ids, known.tobytes()
        if of != self._of:  # seldom
            self._of, self._kind = of, frame.kind[known]
            self._ids = tuple(id_ for id_, is_known in zip(frame.ids, known.tolist(), strict=True) if is_known)
        path, station_m, offset_m = along
        place, ahead = (path, station_m, offset_m), (frame.signal, frame.stop_line_m)
        return Perceived(frame.time_s, self._ids, self._kind, shown(belief.state, known), *place, *ahead)


class EgoPilot:
    """Drives the ego of one episode after the other."""

    _vehicle: Vehicle
    _motion: Motion
    _view: View

    def __init__(self, ego: Guarded) -> None:
        self._ego = ego

    def begin(self, layout: Layout, seed: int, frame: Frame) -> Motion:
        """See `risk_sac.sim.pilot.Pilot.begin`."""
        grip = layout.friction * GRAVITY_MPS2
        length_m, width_m = float(frame.length_m[0]), float(frame.width_m[0])
        self._vehicle = Vehicle(length_m=length_m, width_m=width_m, brake_mps2=min(BRAKE_MPS2, grip), grip_mps2=grip)
        x, y, heading, speed, accel = (
            float(row[0]) for row in (frame.x_m, frame.y_m, frame.heading_rad, frame.speed_mps, frame.accel_mps2)
        )
        self._motion, self._view = Motion(x, y, heading, speed, accel), View()
        route, vehicle = layout.ego.route, self._vehicle
        self._ego.reset(Episode(seed=seed, net=layout.net, route=route, vehicle=vehicle, step_s=STEP_S))
        return self._motion

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        """See `risk_sac.sim.pilot.Pilot.drive`."""
        command = self._ego.act(self._view.perceived(frame, belief, along))
        if isinstance(command, Trajectory):
            command = track(command, self._motion, self._vehicle)
        self._motion = advance(self._motion, command.accel_mps2, command.steering_rad, self._vehicle, STEP_S)
        return self._motion

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
