"""How much memory a worker may take, and how its libraries say that there is no more."""

import errno
import resource

import psutil

# Torch, C++ and the loader of libraries have no class of errors for it.
_SIGNS = ("can't allocate memory", "cannot allocate memory", "out of memory", "bad_alloc", "failed to map segment")


def limit_memory(most_bytes: int) -> None:
    """Refuses this process what goes beyond.

    Only memory that it may write to counts. Of address space, which has a limit too, the libraries take several
    times as much as they use.

    Raises:
      MemoryError: it has taken more already.
    """
    if psutil.Process().memory_info().data > most_bytes:
        raise MemoryError
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = most_bytes if hard == resource.RLIM_INFINITY else min(most_bytes, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def out_of_memory(error: Exception) -> bool:
    """Whether an error says that there is no more."""
    if isinstance(error, MemoryError):
        return True
    if isinstance(error, OSError):
        return error.errno == errno.ENOMEM
    return isinstance(error, RuntimeError | ImportError) and any(sign in str(error).lower() for sign in _SIGNS)
