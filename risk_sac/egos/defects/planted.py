"""Plants defects into an ego, and notes when one of them first changed what the ego does."""

from collections.abc import Callable, Sequence
from importlib import import_module

import numpy as np

from risk_sac.egos.defects.catalogue import Defect
from risk_sac.egos.seam import Command, Ego, Episode, Perceived, Trajectory


class Planted:
    """Ego with defects, and the same ego without them until their commands differ.

    Attributes:
      reached_s: when a defect first changed a command, from the first frame on; None before.
    """

    reached_s: float | None
    _began_s: float | None

    def __init__(self, make: Callable[[], Ego], defects: Sequence[Defect]) -> None:
        """Makes both egos; the first defect is the nearest to the ego."""
        self._sound, self._ego = make(), make()
        for defect in defects:
            decorator = getattr(import_module(f"risk_sac.egos.defects.{defect.kind}"), defect.decorator)
            self._ego = decorator(self._ego, defect.parameter.value)

    def reset(self, episode: Episode) -> None:
        """Begins an episode."""
        self.reached_s = self._began_s = None
        self._sound.reset(episode)
        self._ego.reset(episode)

    def act(self, perceived: Perceived) -> Command:
        """Returns the command of the ego with the defects; the other one is asked until their commands differ."""
        command = self._ego.act(perceived)
        if self._began_s is None:
            self._began_s = perceived.time_s
        if self.reached_s is None and not _same(command, self._sound.act(perceived)):
            self.reached_s = round(perceived.time_s - self._began_s, 6)
        return command

    def close(self) -> None:
        """Closes both egos."""
        self._sound.close()
        self._ego.close()


def _same(command: Command, other: Command) -> bool:
    if isinstance(command, Trajectory) or isinstance(other, Trajectory):
        return type(command) is type(other) and all(map(np.array_equal, command, other))
    return tuple(command) == tuple(other)
