"""Adversaries that repeat the motions of a recorded episode, whatever the ego does."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.family import Family
from risk_sac.scenario.limits import Limits
from risk_sac.sim.control import Adversaries
from risk_sac.sim.solid import VehicleCommand, Walker
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.types import Frame

WALK = ("x_m", "y_m", "heading_rad", "speed_mps", "accel_mps2")
DRIVE = ("speed_mps", "lateral_mps")


class RecordedAdversaries(Adversaries):
    """Adversaries that move as recorded until the recording ends, and then as commanded.

    They keep clear of nothing meanwhile, and their limits are not checked again.
    """

    def __init__(self, family: Family, limits: Limits, frame: Frame, series: Mapping[str, NDArray[Any]]) -> None:
        """Starts from the motion in `frame`, the recording's moment of release."""
        super().__init__(family, limits, frame)
        self._series = series
        self._columns = {str(id_): i for i, id_ in enumerate(series["ids"])}
        self._next = int(np.searchsorted(series["time_s"], series["released_s"])) + 1

    def command(self, action: Sequence[float], frame: Frame, sim: SumoSimulation) -> None:
        """See `Adversaries.command`; the action counts after the end of the recording."""
        if self._next >= len(self._series["time_s"]):
            super().command(action, frame, sim)
            return
        vehicles = {id_: VehicleCommand(*self._row(id_, DRIVE)) for id_ in self._vehicles}
        walkers = {id_: Walker(*self._row(id_, WALK)) for id_ in self._pedestrians}
        for id_, walker in walkers.items():
            self._pedestrians[id_].state = walker
        sim.apply({id_: each for id_, each in vehicles.items() if np.isfinite(each).all()}, walkers)
        self._next += 1

    def keep_limits(self, frame: Frame) -> bool:
        """Continues from what was driven, which was judged when it was recorded."""
        super().keep_limits(frame)
        return True

    def _row(self, id_: str, names: Sequence[str]) -> list[float]:
        column = self._columns[id_]
        return [float(self._series[name][self._next, column]) for name in names]
