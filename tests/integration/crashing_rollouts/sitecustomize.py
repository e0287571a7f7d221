"""Makes rollout processes read address 0 in episode three, step eight."""

import ctypes
import sys

if "risk_sac.search.rollouts" in sys.orig_argv:
    from risk_sac.run_folder.crash_guard import CrashGuard

    note = CrashGuard.step

    def step(self: CrashGuard, number: int) -> None:
        note(self, number)
        if (self._playing, number) == (2, 7):
            ctypes.string_at(0)

    CrashGuard.step = step
