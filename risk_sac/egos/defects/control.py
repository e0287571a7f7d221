"""Defects of control: what becomes of a command on its way to the wheels."""

from collections import deque

from risk_sac.egos.defects.defective import Defective
from risk_sac.egos.seam import Command, Perceived

RELEASED_S = 0.4
LOCKED_SHARE = 0.5  # of the grip that locked wheels still bear
HARD_MPS2 = 4.0


class WeakBrakes(Defective):
    """Brakes with a limited deceleration."""

    def does(self, command: Command, p: Perceived) -> Command:
        """Bounds the braking."""
        control = self.control(command, p)
        return control._replace(accel_mps2=max(control.accel_mps2, -self.value))


class SlowBrakes(Defective):
    """Builds its braking up slowly; releases it at once."""

    def begin(self) -> None:
        """Does not brake yet."""
        self._accel_mps2 = 0.0

    def does(self, command: Command, p: Perceived) -> Command:
        """Bounds the rate at which the acceleration falls below zero."""
        control = self.control(command, p)
        lowest = min(self._accel_mps2, 0.0) - self.value * self.step_s
        self._accel_mps2 = max(control.accel_mps2, lowest)
        return control._replace(accel_mps2=self._accel_mps2)


class LateActuators(Defective):
    """Accelerates and brakes some time after the command."""

    def begin(self) -> None:
        """Rolls on until the first command arrives."""
        self._decided = deque([0.0] * self.steps(self.value))

    def does(self, command: Command, p: Perceived) -> Command:
        """Returns an earlier acceleration."""
        control = self.control(command, p)
        self._decided.append(control.accel_mps2)
        return control._replace(accel_mps2=self._decided.popleft())


class LocksWheels(Defective):
    """Locks its wheels where it brakes harder than a share of the grip; locked wheels bear half of it."""

    def does(self, command: Command, p: Perceived) -> Command:
        """Reduces hard braking to what locked wheels bear."""
        control, grip = self.control(command, p), self.vehicle.grip_mps2
        if control.accel_mps2 > -self.value * grip:
            return control
        return control._replace(accel_mps2=-LOCKED_SHARE * grip)


class PumpsBrakes(Defective):
    """Releases the brakes for a moment after braking hard for some time."""

    def begin(self) -> None:
        """Does not brake yet."""
        self._braked = 0

    def does(self, command: Command, p: Perceived) -> Command:
        """Takes the braking away for `RELEASED_S`."""
        control = self.control(command, p)
        self._braked = self._braked + 1 if control.accel_mps2 < -HARD_MPS2 else 0
        if self._braked <= self.steps(self.value):
            return control
        self._braked %= self.steps(self.value + RELEASED_S)
        return control._replace(accel_mps2=0.0)


class SteersAside(Defective):
    """Steers by a constant angle beside the commanded one, to the left if positive."""

    def does(self, command: Command, p: Perceived) -> Command:
        """Adds the angle."""
        control = self.control(command, p)
        return control._replace(steering_rad=control.steering_rad + self.value)
