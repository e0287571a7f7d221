"""What processes take of the machine."""

import statistics
import threading
from dataclasses import dataclass

import psutil

SAMPLE_S = 1.0
MIB = 1 << 20


def processor_s(*pids: int) -> float:
    """Processor time that processes have used so far, all threads together, s; one that has ended counts nothing."""
    total = 0.0
    for pid in pids:
        try:
            times = psutil.Process(pid).cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += times.user + times.system
    return total


@dataclass(frozen=True, slots=True)
class Holding:
    """What a process held during a phase, as medians of its samples."""

    memory_mib: float
    files: float


class Watch:
    """Looks every second, from its entry to its exit."""

    def __init__(self, pid: int) -> None:
        self._process = psutil.Process(pid)
        self._samples: list[tuple[float, int]] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> "Watch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    @property
    def holding(self) -> Holding:
        """Of the time that is over."""
        memory, files = zip(*self._samples, strict=True)
        return Holding(statistics.median(memory), statistics.median(files))

    def _look(self) -> None:
        while True:
            self._samples.append((self._process.memory_info().rss / MIB, self._process.num_fds()))
            if self._over.wait(SAMPLE_S):
                return
