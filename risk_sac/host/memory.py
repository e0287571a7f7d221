"""Limits the memory of a process, and recognises the errors of one that has reached its limit."""

import errno
import resource

import psutil

# Torch, C++ and the loader of libraries have no class of errors for it.
_OUT_OF_MEMORY = (
    "can't allocate memory",
    "cannot allocate memory",
    "out of memory",
    "bad_alloc",
    "failed to map segment",
)


def limit_memory(most_bytes: int) -> None:
    """Limits the memory that this process, and each that it starts, may write to.

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
    """Returns the memory that this process may write to; None where it is not limited."""
    most, _ = resource.getrlimit(resource.RLIMIT_DATA)
    return None if most == resource.RLIM_INFINITY else most


def out_of_memory(error: Exception) -> bool:
    """Returns whether an error says that there is no more memory."""
    if isinstance(error, MemoryError):
        return True
    if isinstance(error, OSError):
        return error.errno == errno.ENOMEM
    return isinstance(error, RuntimeError | ImportError) and any(sign in str(error).lower() for sign in _OUT_OF_MEMORY)
