"""Processors, cache folder, loopback addresses and memory limit of this machine."""

import errno
import ipaddress
import math
import os
import re
import resource
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import psutil

from risk_sac.errors import ConfigError

UNWRITABLE = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOENT, errno.ENOTDIR, errno.EEXIST)
"""Errors of a folder that cannot be made or written, whatever room there is."""
NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EBADF)
"""Errors of a file system that locks nothing, or no folder, such as a network's."""


def cores(process: Path = Path("/proc/self")) -> int:
    """Counts the processors that this process may use, by affinity and quotas.

    Args:
      process: the process's folder in /proc.
    """
    able = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(able, math.ceil(min(_quotas(process), default=able))))


ROLLOUTS = "RISK_SAC_ROLLOUTS"
"""Variable that says how many processes play the episodes of one run."""
MOST_EACH = 16  # episodes of a round for each process; more would only be chosen with less known


def rollout_limit() -> int | None:
    """Returns the most processes of a run by RISK_SAC_ROLLOUTS, or None.

    Raises:
      ConfigError: it is no positive integer.
    """
    given = os.environ.get(ROLLOUTS)
    if not given:
        return None
    if not given.isdecimal() or int(given) < 1:
        raise ConfigError(ROLLOUTS, repr(given), "an integer, 1 or more", "leave it out for one per processor")
    return int(given)


def rollout_processes() -> int:
    """Returns how many processes may play a run; raises as `rollout_limit` does."""
    return rollout_limit() or cores()


def check_batch(batch: int) -> None:
    """Refuses rounds of more episodes than a search here gains from.

    Raises:
      ConfigError: naming the batch.
    """
    processes = max(cores(), rollout_processes())
    if batch > (most := MOST_EACH * processes):
        expected = f"at most {most}, {MOST_EACH} for each of the {processes} processes that play here"
        raise ConfigError("budget.batch", f"{batch}", expected, f"choose a smaller batch, or set {ROLLOUTS}")


def _quotas(process: Path) -> Iterator[float]:
    """CPU quotas of this process's control groups and their ancestors, in processors."""
    try:
        groups = [line.split(":", 2)[1:] for line in (process / "cgroup").read_text("utf-8", "replace").splitlines()]
        mounts = [line.split(" - ") for line in (process / "mountinfo").read_text("utf-8", "replace").splitlines()]
    except OSError:  # no Linux
        return
    for place, kind in mounts:
        fields, (type_, *_, options) = place.split(), kind.split()
        if type_ == "cgroup2":
            controller = ""
        elif type_ == "cgroup" and "cpu" in options.split(","):
            controller = "cpu"
        else:
            continue
        root, folder = (Path(_unescaped(field)) for field in fields[3:5])
        for controllers, path in groups:
            if controller in controllers.split(","):
                # In a container the group may be named as outside of it, where the mount does not show it.
                below = PurePosixPath(path).relative_to(root) if PurePosixPath(path).is_relative_to(root) else ""
                group = folder / below
                for each in (group, *group.parents[: len(group.parts) - len(folder.parts)]):
                    yield from _quota(each)


def _quota(group: Path) -> Iterator[float]:
    """The CPU quota of one control group, if any, in processors."""
    try:
        if (group / "cpu.max").exists():
            quota, period = (group / "cpu.max").read_text().split()
        else:
            quota, period = ((group / f"cpu.cfs_{name}_us").read_text().strip() for name in ("quota", "period"))
        if quota not in ("max", "-1"):
            yield int(quota) / int(period)
    except (OSError, ValueError, ZeroDivisionError):  # the root has none
        return


def _unescaped(field: str) -> str:
    return re.sub(r"\\([0-7]{3})", lambda found: chr(int(found[1], 8)), field)


def user_cache() -> Path | None:
    """Returns the user's cache folder; None where there is no home."""
    told = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(told):  # others are to be ignored, says the XDG specification
        return Path(told)
    try:
        home = Path.home()
    except RuntimeError:
        return None
    return home / ".cache" if home.is_absolute() else None


def is_loopback(host: str) -> bool:
    """Returns whether a host is loopback, such as `127.8.9.1` or `localhost`."""
    host = host.lower().removeprefix("[").removesuffix("]")
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host == "localhost"
    mapped = getattr(address, "ipv4_mapped", None)
    return (mapped or address).is_loopback


# Torch, C++ and the loader of libraries have no class of errors for it.
_OUT_OF_MEMORY = (
    "can't allocate memory",
    "cannot allocate memory",
    "out of memory",
    "bad_alloc",
    "failed to map segment",
)


def limit_memory(most_bytes: int) -> None:
    """Limits the memory that this process and its children may write to.

    Libraries reserve far more address space than they use.

    Raises:
      MemoryError: it has taken more already.
    """
    if psutil.Process().memory_info().data > most_bytes:
        raise MemoryError
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = most_bytes if hard == resource.RLIM_INFINITY else min(most_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def memory_limit_bytes() -> int | None:
    """Returns how much memory this process may write to, None if unlimited."""
    most, _ = resource.getrlimit(resource.RLIMIT_DATA)
    return None if most == resource.RLIM_INFINITY else most


def out_of_memory(error: Exception) -> bool:
    """Returns whether an error says that there is no more memory."""
    if isinstance(error, MemoryError):
        return True
    if isinstance(error, OSError):
        return error.errno == errno.ENOMEM
    return isinstance(error, RuntimeError | ImportError) and any(sign in str(error).lower() for sign in _OUT_OF_MEMORY)
