"""How the C library hands out memory to threads."""

import ctypes
import platform

ARENA_MAX = -8  # M_ARENA_MAX of glibc's malloc.h
ARENAS = 2


def share_arenas() -> None:
    """Lets all threads share two of glibc's arenas; does nothing with another C library.

    By default each thread that answers requests gets one of its own, which is never given back, and over hours all of
    them grow to what the largest answer took: the server seems to leak.

    Source: mallopt(3).
    """
    if platform.libc_ver()[0] == "glibc":
        ctypes.CDLL(None).mallopt(ARENA_MAX, ARENAS)
