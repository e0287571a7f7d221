"""Compilation of the per-step measures.

A step of a small SUMO scene takes some 50 µs, less than a dozen numpy calls on five actors; compiled loops
keep the measures from costing several times the simulation.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])
SETTINGS = vars(numba.config)
HERE = Path(__file__).parent
COMPILED = (  # where compiled functions are, and the constants that are compiled into them
    "geometry.py",
    "jit.py",
    "observation.py",
    "observation_layout.py",
    "types.py",
    "agents/normalisation.py",
    "agents/priority.py",
    "agents/sum_tree.py",
    "egos/bicycle.py",
    "egos/pilot.py",
    "egos/road.py",
    "risk/*.py",
    "scenario/layout.py",
    "scenario/limits.py",
    "sim/*.py",
    "verdicts/*.py",
)


def _cache_folder() -> str:
    """A folder for what these sources compile to.

    numba looks at a function's own file only: after a change in a file whose functions it calls, the function would be
    taken from disk with the old ones in it.
    """
    digest = hashlib.sha256()
    for source in sorted(path for pattern in COMPILED for path in HERE.glob(pattern)):
        digest.update(source.read_bytes())
    return str(Path(SETTINGS["CACHE_DIR"] or HERE / "__pycache__") / digest.hexdigest()[:16])


SETTINGS["CACHE_DIR"] = _cache_folder()


def compiled(function: Function) -> Function:
    """Compiles on first call; the result is kept on disk for the next process where there is a place for it."""
    return _compiled(function, set())


def compiled_in_any_order(function: Function) -> Function:
    """As `compiled`, but for sums that may be added up in any order: several at a time, as the processor does it."""
    return _compiled(function, {"reassoc", "contract"})


def _compiled(function: Function, fastmath: set[str]) -> Function:
    try:
        return cast(Function, numba.njit(cache=True, fastmath=fastmath)(function))
    except RuntimeError:  # a read-only installation without a cache folder
        return cast(Function, numba.njit(fastmath=fastmath)(function))
