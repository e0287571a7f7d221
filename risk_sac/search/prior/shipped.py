"""The shipped prior: the script model, and a library for each family of the paper.

prior/weights/scripts.npz    the script model
prior/weights/<family>.npz   a library; plain arrays both, README.md says how they were made
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.families import FAMILIES
from risk_sac.search.prior.files import DATA, arrays_of, write_arrays
from risk_sac.search.prior.script_model import ScriptModel
from risk_sac.search.scripts import SIZE
from risk_sac.world.types import Floats

GRID = 65535  # of points in files
MODEL = "scripts.npz"


@dataclass(frozen=True, slots=True)
class ScriptLibrary:
    """Points that led to failures of a family: in the unit cube of its space, genes behind."""

    family: str
    points: Floats  # n x inputs
    kinds: tuple[str, ...]  # n, names of variants
    fails: NDArray[np.float32]  # n, chance by the script model that an ego of which nothing is known fails


def write_model(path: Path, model: ScriptModel, card: Mapping[str, object]) -> None:
    """Writes a script model as plain arrays."""
    write_arrays(path, {"kinds": model.kinds, "egos": model.egos, **card}, model.arrays())


def read_model(path: Path) -> ScriptModel:
    """Reads what `write_model` wrote; nothing is unpickled.

    Raises:
      ConfigError: the file is damaged, too large, or for tokens of another layout.
    """
    with arrays_of(path) as (meta, arrays):
        return ScriptModel.from_arrays(arrays, tuple(meta["kinds"]), tuple(meta["egos"]))


def write_library(path: Path, library: ScriptLibrary) -> None:
    """Writes a library as plain arrays."""
    points = np.round(library.points * GRID).astype(np.uint16)
    arrays = {"points": points, "fails": library.fails.astype(np.float16)}
    write_arrays(path, {"family": library.family, "kinds": library.kinds}, arrays)


def read_library(path: Path) -> ScriptLibrary:
    """Reads what `write_library` wrote; nothing is unpickled.

    Raises:
      ConfigError: the file is damaged, too large, or for scenes and scripts of another layout.
    """
    with arrays_of(path) as (meta, arrays):
        points = arrays["points"].astype(np.float64) / GRID
        family, kinds, fails = meta["family"], tuple(meta["kinds"]), arrays["fails"].astype(np.float32)
        wanted = inputs_of(family)
        if points.shape != (len(kinds), wanted) or fails.shape != (len(kinds),):
            raise ValueError(f"points of {points.shape[1:]} numbers, not {wanted}")
    return ScriptLibrary(family, points, kinds, fails)


def inputs_of(family: str) -> int:
    """Numbers of a point of a shipped family: scene parameters, then genes."""
    shipped = FAMILIES[family]
    return shipped.space.dimension + SIZE * len(shipped.adversaries)


@cache
def shipped_model() -> ScriptModel:
    """Returns the shipped script model."""
    return read_model(DATA / MODEL)


@cache
def shipped_library(family: str) -> ScriptLibrary:
    """Returns the library of a family of the paper."""
    return read_library(DATA / f"{family}.npz")
