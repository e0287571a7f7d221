"""Compilation of the per-step measures.

A step of a small SUMO scene takes some 50 µs, less than a dozen numpy calls on five actors; compiled loops
keep the measures from costing several times the simulation.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compiles on first call; the result is kept on disk for the next process where there is a place for it."""
    try:
        return cast(Function, numba.njit(cache=True)(function))
    except RuntimeError:  # a read-only installation without a cache folder
        return cast(Function, numba.njit(function))
