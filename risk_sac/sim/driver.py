"""A driver of SUMO's that is told what it has to stop for or to follow.

Its code is SUMO's: the distance is ours, what speed it is worth is said by the driver's own car-following model
(`getStopSpeed`, `getFollowSpeed`), and the smaller of that and of what SUMO's models want anyway is driven.
"""

import math

import libsumo

from risk_sac.sim.lookout import targets
from risk_sac.sim.paths import Along
from risk_sac.types import STEP_S, Bools, Floats, Frame, Kind

NORMAL_DECEL_MPS2 = 4.5  # what SUMO assumes of a leader, and its default for passenger cars
JERK_MPS3 = 12.65  # at which a braking builds up (UN R157, the careful driver)
OWN_CHOICE_MPS = -1.0  # SUMO's word for the speed that its models choose
SAFE_SPEED_MODE = 27  # SUMO's checks, but for its bound on braking: an emergency may exceed the normal deceleration


class Driver:
    """One vehicle that SUMO drives, and what it was told last.

    It decides once in its reaction time, as SUMO's models do, and keeps its acceleration in between.

    Attributes:
      telling: whether it is held to a speed at present.
    """

    def __init__(
        self, vehicle: str, reaction_s: float, emergency_mps2: float, cruise_mps: float = OWN_CHOICE_MPS
    ) -> None:
        """Takes its place beside a vehicle of the simulation.

        Args:
          vehicle: its id.
          reaction_s: time between two decisions.
          emergency_mps2: the hardest it can brake.
          cruise_mps: the speed it is told to keep where nothing else binds.
        """
        self._vehicle = vehicle
        self._cruise_mps = cruise_mps
        self._period = round(reaction_s / STEP_S)
        self._emergency_mps2 = emergency_mps2
        self._step = 0
        self._accel_mps2: float | None = None  # None: nothing to tell
        self.telling = False
        get = libsumo.vehicle
        get.setSpeedMode(vehicle, SAFE_SPEED_MODE)
        get.setSpeed(vehicle, cruise_mps)
        self._length, self._width = get.getLength(vehicle), get.getWidth(vehicle)
        self._accel, self._min_gap = get.getAccel(vehicle), get.getMinGap(vehicle)

    def tell(self, row: int, frame: Frame, along: Along, limit_mps: float, candidate: Bools) -> None:
        """Tells SUMO how fast the vehicle may drive in the next step.

        Args:
          row: of the vehicle in the frame.
          frame: all actors now.
          along: the vehicle on its path.
          limit_mps: of its lane.
          candidate: `n` actors of the frame; whom it knows of and looks out for.
        """
        speed = float(frame.speed_mps[row])
        if self._step % self._period == 0:
            self._accel_mps2 = self._decide(speed, frame, along, limit_mps, candidate)
        self._step += 1
        if self._accel_mps2 is None:
            if self.telling:
                libsumo.vehicle.setSpeed(self._vehicle, self._cruise_mps)
                self.telling = False
            return
        self.telling = True
        braking_so_far = min(float(frame.accel_mps2[row]), 0.0)
        accel = max(self._accel_mps2, braking_so_far - JERK_MPS3 * STEP_S)
        libsumo.vehicle.setSpeed(self._vehicle, max(speed + accel * STEP_S, 0.0))

    def _decide(self, speed: float, frame: Frame, along: Along, limit_mps: float, candidate: Bools) -> float | None:
        """The acceleration that its model wants for the nearest of the targets; None where none binds."""
        gap, lead = targets(
            along.path,
            along.station_m,
            along.offset_m,
            self._length,
            self._width,
            speed,
            self._accel,
            limit_mps,
            frame.x_m,
            frame.y_m,
            frame.heading_rad,
            frame.vx_mps,
            frame.vy_mps,
            frame.length_m / 2,
            frame.width_m / 2,
            frame.kind == Kind.VEHICLE,
            candidate,
        )
        wanted = math.inf
        for distance, lead_mps in zip(gap.tolist(), lead.tolist(), strict=True):
            if distance < math.inf:
                wanted = min(wanted, self._worth(speed, distance - self._min_gap, lead_mps))
        if wanted >= speed + self._accel * STEP_S or 0.0 <= self._cruise_mps <= wanted:
            return None
        return max((wanted - speed) / STEP_S, -self._emergency_mps2)

    def _worth(self, speed: float, gap_m: float, lead_mps: float) -> float:
        """The speed of its car-following model for a gap."""
        gap_m = max(gap_m, 0.0)
        if lead_mps > 0.0:
            return float(libsumo.vehicle.getFollowSpeed(self._vehicle, speed, gap_m, lead_mps, NORMAL_DECEL_MPS2))
        return float(libsumo.vehicle.getStopSpeed(self._vehicle, speed, gap_m))


def about_to_cross(x: float, y: float, vx: float, vy: float, roadway: Floats) -> bool:
    """Whether a pedestrian is on the carriageway, or will be within a second at its present velocity.

    Args:
      x: its place.
      y: its place.
      vx: its velocity.
      vy: its velocity.
      roadway: `areas x 4`: lowest and highest x, lowest and highest y.
    """
    for share in (0.0, 0.5, 1.0):
        px, py = x + share * vx, y + share * vy
        for low_x, high_x, low_y, high_y in roadway.tolist():
            if low_x <= px <= high_x and low_y <= py <= high_y:
                return True
    return False
