"""Defects of planning: what the ego does about what it rightly expects."""

import numpy as np

from risk_sac.egos.defects.defective import VEHICLE, Defective, in_front, only, turned
from risk_sac.egos.defects.prediction import SAME_WAY, offsets
from risk_sac.egos.driving import Driver, idm, stop_at_signal, time_to_collision
from risk_sac.egos.seam import Command, Control, Perceived
from risk_sac.world.types import SPEED, WIDTH

EMERGENCY_MPS2, GENTLE_MPS2 = 3.5, 1.0
ASIDE_M = 0.4  # room beside its body
LEAST_PLANNED_M = 8.0


class Tailgates(Defective):
    """Follows with a short headway; its emergency braking is as before."""

    def begin(self) -> None:
        """Makes a lookout of its own."""
        self._driver = Driver()
        self._driver.reset(self.episode)

    def does(self, command: Command, p: Perceived) -> Command:
        """Brakes no more than it takes to keep the short headway, except in an emergency."""
        control, ahead = self.control(command, p), self._driver.ahead(p)
        if control.accel_mps2 < -EMERGENCY_MPS2:
            return control
        wanted = idm(p, self.vehicle, [*ahead, *stop_at_signal(p)], self.value)
        return control._replace(accel_mps2=max(control.accel_mps2, wanted))


class RestartsEarly(Defective):
    """Starts again as soon as nothing is on its line, whatever is about to come there."""

    def sees(self, p: Perceived) -> Perceived:
        """Drops what is beside its line while it is slow."""
        if p.state[SPEED, 0] > self.value:
            return p
        return only(p, np.abs(offsets(p)) < (p.state[WIDTH, 0] + p.state[WIDTH]) / 2 + ASIDE_M)


class ShortGap(Defective):
    """Takes gaps in crossing and oncoming traffic that are some seconds long."""

    def sees(self, p: Perceived) -> Perceived:
        """Drops vehicles that do not go its way and need longer than that to get here."""
        distance = np.hypot(*in_front(p))
        far = distance > self.value * np.maximum(p.state[SPEED], 0.1)
        return only(p, ~(far & (p.kind == VEHICLE) & (turned(p) < SAME_WAY)))


class NearestOnly(Defective):
    """Plans for the nearest so many actors ahead, and for none behind."""

    def sees(self, p: Perceived) -> Perceived:
        """Drops all but the nearest ahead."""
        ahead_m, left_m = in_front(p)
        distance = np.where(ahead_m >= 0.0, np.hypot(ahead_m, left_m), np.inf)
        nearest = np.argsort(distance, kind="stable")[: 1 + round(self.value)]  # the ego is the first
        return only(p, np.isin(np.arange(len(p.ids)), nearest))


class ShortHorizon(Defective):
    """Plans for what it reaches within a time."""

    def sees(self, p: Perceived) -> Perceived:
        """Drops what is farther away than it drives in that time."""
        return only(p, np.hypot(*in_front(p)) < LEAST_PLANNED_M + self.value * p.state[SPEED, 0])


class SlowReplanning(Defective):
    """Replans its speed periodically; steers in every step."""

    def begin(self) -> None:
        """Has no plan yet."""
        self._left, self._accel_mps2 = 0, 0.0

    def does(self, command: Command, p: Perceived) -> Command:
        """Keeps the acceleration of the latest plan."""
        control = self.control(command, p)
        if self._left == 0:
            self._left, self._accel_mps2 = self.steps(self.value), control.accel_mps2
        self._left -= 1
        return control._replace(accel_mps2=self._accel_mps2)


class LateBraking(Defective):
    """Brakes for others only once the time to collision falls below a threshold."""

    def begin(self) -> None:
        """Makes a lookout of its own."""
        self._driver = Driver()
        self._driver.reset(self.episode)

    def does(self, command: Command, p: Perceived) -> Command:
        """Holds its braking back, except before signals."""
        control, ahead = self.control(command, p), self._driver.ahead(p)
        late = time_to_collision(float(p.state[SPEED, 0]), ahead) > self.value and not stop_at_signal(p)
        return Control(max(control.accel_mps2, -GENTLE_MPS2), control.steering_rad) if late else control
