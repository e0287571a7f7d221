"""An ego at the wheel: it is shown what it perceives, and its car does what it commands."""

import numpy as np

from risk_sac.egos.bicycle import advance
from risk_sac.egos.guard import Guarded
from risk_sac.egos.seam import Episode, Perceived, Trajectory, Vehicle
from risk_sac.egos.tracking import track
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.sim.ego import Belief
from risk_sac.sim.paths import Along
from risk_sac.sim.pilot import Motion
from risk_sac.types import ACCEL, LATERAL, OFFSET, SPEED, STEP_S, VX, VY, Frame

BRAKE_MPS2 = 9.0  # as SUMO's driver can, on dry asphalt
UNTOLD = [LATERAL, ACCEL, OFFSET]


class EgoPilot:
    """Drives the ego of one episode after the other."""

    _vehicle: Vehicle
    _motion: Motion

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
        self._motion = Motion(x, y, heading, speed, accel)
        self._ego.reset(
            Episode(seed=seed, net=layout.net, route=layout.ego.route, vehicle=self._vehicle, step_s=STEP_S)
        )
        return self._motion

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        """See `risk_sac.sim.pilot.Pilot.drive`."""
        command = self._ego.act(perceived(frame, belief, along))
        if isinstance(command, Trajectory):
            command = track(command, self._motion, self._vehicle)
        self._motion = advance(self._motion, command.accel_mps2, command.steering_rad, self._vehicle, STEP_S)
        return self._motion

    def close(self) -> None:
        """Lets the ego go."""
        self._ego.close()


def perceived(frame: Frame, belief: Belief, along: Along) -> Perceived:
    """What the ego is shown: those it knows of, as far as its sensor and its memory tell of them."""
    ids, kind, state, known = frame.ids, frame.kind, belief.state.copy(), belief.known
    if not known.all():
        ids = tuple(id_ for id_, is_known in zip(ids, known.tolist(), strict=True) if is_known)
        kind, state = kind[known], np.compress(known, state, axis=1)
    state[SPEED, 1:] = np.hypot(state[VX, 1:], state[VY, 1:])
    state[UNTOLD, 1:] = np.nan
    path, station_m, offset_m = along
    return Perceived(frame.time_s, ids, kind, state, path.points, station_m, offset_m, frame.signal, frame.stop_line_m)
