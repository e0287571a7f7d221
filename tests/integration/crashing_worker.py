"""The real worker with a simulator that reads address 0 in the eighth step of each run's third episode."""

import ctypes
import sys

from risk_sac.execution import worker
from risk_sac.run_folder.crash_guard import CrashGuard

note = CrashGuard.step


def step(self: CrashGuard, number: int) -> None:
    note(self, number)
    if (self._playing, number) == (2, 7):
        ctypes.string_at(0)


CrashGuard.step = step  # type: ignore[method-assign]
sys.exit(worker.main())
