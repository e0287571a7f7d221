"""What the checker may use; it binds itself before it reads a byte of the upload."""

import resource
import signal

from service.networks import limits


def bind() -> None:
    """Bound what this process may use, for good."""
    signal.alarm(limits.WALL_S)  # should the server die and nobody watch
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_CPU, limits.CPU_S)
    _limit(resource.RLIMIT_AS, limits.MEMORY_BYTES)
    _limit(resource.RLIMIT_NOFILE, limits.OPEN_FILES)
    _limit(resource.RLIMIT_FSIZE, 2 * limits.MAX_EXPANDED_BYTES)  # what is written anew has more end tags


def bind_simulator() -> None:
    """Leave the simulator no room for output, and no more processes or threads unless they are root's."""
    _limit(resource.RLIMIT_FSIZE, limits.LOG_BYTES)
    _limit(resource.RLIMIT_NPROC, 0)


def _limit(resource_: int, most: int) -> None:
    _, present = resource.getrlimit(resource_)
    if present != resource.RLIM_INFINITY:
        most = min(most, present)  # only root may raise it
    resource.setrlimit(resource_, (most, most))
