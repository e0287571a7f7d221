"""What is this process's own, and goes with it: what is mounted, what listens, and who was started."""

import ctypes
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

CLONE_NEWNS = 0x00020000
CLONE_NEWNET = 0x40000000
PR_SET_CHILD_SUBREAPER = 36
# crun knows version 1 and version 2 of cgroups, but not both at once.
HYBRID_CGROUPS = Path("/sys/fs/cgroup/unified")
BUSY_S = 20.0


def own_mounts() -> None:
    """From here on, mounts are this process's and its children's alone."""
    _unshare(CLONE_NEWNS)
    subprocess.run(["mount", "--make-rprivate", "/"], check=True)
    if HYBRID_CGROUPS.is_mount():
        subprocess.run(["umount", HYBRID_CGROUPS], check=True)


def own_network() -> None:
    """From here on there is a loopback device, and nothing else: no port is taken, none is open to others."""
    _unshare(CLONE_NEWNET)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)


def own_processes() -> None:
    """From here on, what its children leave behind when they end becomes this process's child, not the machine's."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)


def end_processes() -> None:
    """Kills the children, and what they leave behind, until there is none."""
    while children := Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        for child in map(int, children):
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def delete(folder: Path) -> None:
    """Deletes a folder with what is mounted in it, again while an engine's own cleaning up has it busy."""
    end = time.monotonic() + BUSY_S
    while True:
        points = [line.split()[4] for line in Path("/proc/self/mountinfo").read_text().splitlines()]
        for point in sorted((each for each in points if Path(each).is_relative_to(folder)), reverse=True):
            subprocess.run(["umount", "--lazy", point], check=False)
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists() or time.monotonic() > end:
            return
        time.sleep(0.5)


def _unshare(kind: int) -> None:
    """`os.unshare` of Python 3.12."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.unshare(kind) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
