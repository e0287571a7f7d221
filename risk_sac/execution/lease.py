"""How long a worker may be silent, or busy without a result, before it counts as lost. Pure.

A worker sends heartbeats. One whose interpreter is held up, by a long compilation say, cannot, but it uses its
processor; one that was stopped does neither.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Signs:
    """Signs of life of a worker since its start."""

    words: int = 0  # lines it has written
    episodes: int = 0  # of them, those that told of an episode
    processor_s: float | None = None  # time its processor was used, s; None if that is unknown


class Lease:
    """Patience with one worker, used up only while somebody watches: a server that was held up itself knows nothing."""

    def __init__(self, lease_s: float, stall_s: float) -> None:
        self._lease_s = lease_s
        self._stall_s = stall_s
        self._signs = Signs()
        self._silent_s = self._stalled_s = 0.0

    def passed(self, watched_s: float, signs: Signs) -> str | None:
        """Counts the time since the last call; the reason why the worker is lost, if it is.

        Args:
          watched_s: how much of that time somebody watched, s.
          signs: what there are now.
        """
        before, self._signs = self._signs, signs
        self._silent_s = 0.0 if signs != before else self._silent_s + watched_s
        self._stalled_s = 0.0 if signs.episodes != before.episodes else self._stalled_s + watched_s
        if self._silent_s >= self._lease_s:
            return f"worker gave no sign of life for {self._lease_s:g} s"
        if self._stalled_s >= self._stall_s:
            return f"worker finished no episode for {self._stall_s:g} s"
        return None
