"""A driver of SUMO's that is told what it has to stop for or to follow.

Its code is SUMO's: the distance is ours, what speed it is worth is said by the driver's own car-following model
(`getStopSpeed`, `getFollowSpeed`), and the smaller of that and of what SUMO's models want anyway is driven.
"""

import math

import libsumo

from risk_sac.sim.lookout import targets
from risk_sac.sim.paths import Along
from risk_sac.types import STEP_S, Bools, Floats

NORMAL_DECEL_MPS2 = 4.5  # what SUMO assumes of a leader, and its default for passenger cars
JERK_MPS3 = 12.65  # at which a braking builds up (UN R157, the careful driver)
BUILD_UP_S = NORMAL_DECEL_MPS2 / JERK_MPS3  # which its model, whose braking steps, does not reckon with
OWN_CHOICE_MPS = -1.0  # SUMO's word for the speed that its models choose
SAFE_MODE = 31  # all of SUMO's checks; told speeds are then held to the normal deceleration
EMERGENCY_MODE = 26  # without those of safe speed and of deceleration


class Driver:
    """One vehicle that SUMO drives, and what it was told last.

    It decides once in its reaction time, as SUMO's models do, and keeps its acceleration in between.

    Attributes:
      telling: whether it is held to a speed at present.
      cruise_mps: the speed it is told to keep where nothing else binds; below 0 SUMO chooses.
      wanted_mps2: the acceleration that it decided on; None: it has nothing to be told.
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
        self.cruise_mps = cruise_mps
        self._period = round(reaction_s / STEP_S)
        self._emergency_mps2 = emergency_mps2
        self._step = 0
        self.wanted_mps2: float | None = None
        self.telling = False
        get = libsumo.vehicle
        get.setSpeed(vehicle, cruise_mps)
        self._accel, self._min_gap = get.getAccel(vehicle), get.getMinGap(vehicle)

    @property
    def due(self) -> bool:
        """Whether it decides anew in this step."""
        return self._step % self._period == 0

    def tell(self, speed_mps: float, accel_mps2: float) -> None:
        """Tells SUMO how fast the vehicle may drive in the next step.

        Args:
          speed_mps: its own now.
          accel_mps2: in the step before.
        """
        self._step += 1
        if self.wanted_mps2 is None:
            if self.telling:
                libsumo.vehicle.setSpeedMode(self._vehicle, SAFE_MODE)
                libsumo.vehicle.setSpeed(self._vehicle, self.cruise_mps)
                self.telling = False
            return
        self._hold_to(self.wanted_mps2, speed_mps, accel_mps2)

    def brake(self, speed_mps: float, accel_mps2: float, braking_mps2: float) -> None:
        """Makes it brake at least so hard in the next step, whatever it was told."""
        accel = -min(braking_mps2, self._emergency_mps2)
        if self.wanted_mps2 is None or accel < self.wanted_mps2:
            self._hold_to(accel, speed_mps, accel_mps2)

    def _hold_to(self, wanted_mps2: float, speed_mps: float, accel_mps2: float) -> None:
        """Tells SUMO the speed after a step of this acceleration, or of what the build-up leaves of it."""
        self.telling = True
        accel = max(wanted_mps2, min(accel_mps2, 0.0) - JERK_MPS3 * STEP_S)
        libsumo.vehicle.setSpeedMode(self._vehicle, EMERGENCY_MODE if accel < -NORMAL_DECEL_MPS2 else SAFE_MODE)
        libsumo.vehicle.setSpeed(self._vehicle, max(speed_mps + accel * STEP_S, 0.0))

    def decide(
        self, own: int, speed: float, along: Along, state: Floats, vehicle: Bools, candidate: Bools
    ) -> float | None:
        """The acceleration that its model wants for the nearest of the targets; None where none binds.

        Args:
          own: its column among the actors.
          speed: its own, m/s.
          along: the vehicle on its path.
          state: of all `n` actors.
          vehicle: `n`, who is a vehicle.
          candidate: `n`, whom it knows of and looks out for.
        """
        path, station_m, offset_m = along
        found = targets(path.points, station_m, offset_m, own, self._accel, state, vehicle, candidate)
        if not len(found):
            return None
        wanted = math.inf
        for _, gap_m, lead_mps in found.tolist():
            room_m = gap_m - self._min_gap - BUILD_UP_S * max(speed - lead_mps, 0.0)
            wanted = min(wanted, self._worth(speed, room_m, lead_mps))
        if wanted >= speed + self._accel * STEP_S or 0.0 <= self.cruise_mps <= wanted:
            return None
        return max((wanted - speed) / STEP_S, -self._emergency_mps2)

    def _worth(self, speed: float, gap_m: float, lead_mps: float) -> float:
        """The speed of its car-following model for a gap."""
        gap_m = max(gap_m, 0.0)
        if lead_mps > 0.0:
            return float(libsumo.vehicle.getFollowSpeed(self._vehicle, speed, gap_m, lead_mps, NORMAL_DECEL_MPS2))
        return float(libsumo.vehicle.getStopSpeed(self._vehicle, speed, gap_m))
