"""The search goes first: who answers does not push a worker off its core."""

import contextlib
import os
import threading


def give_way(niceness: int) -> None:
    """Let this thread, and those that it starts from now on, wait for the scheduler's next tick when they wake.

    A worker that is pushed off its core finds its caches cold, and so does who pushes it. Beside workers that keep all
    cores busy, answers take some milliseconds longer, and cost the search less; otherwise nothing changes.

    Args:
      niceness: added to the threads' own.
    """
    with contextlib.suppress(AttributeError, OSError):  # Linux has all of it, and some containers forbid it
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        thread = threading.get_native_id()
        os.setpriority(os.PRIO_PROCESS, thread, os.getpriority(os.PRIO_PROCESS, thread) + niceness)
