"""The prior of a pattern: what was trained on its shipped family, and how a problem's points map onto that.

A family at a place of the user has the parameters of its pattern, perhaps with other bounds. So points are translated
by the parameters' names and values.

prior/weights/<family>.npz   plain arrays; README.md says how they were made
"""

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from risk_sac.errors import ConfigError
from risk_sac.prior.script_model import ScriptModel
from risk_sac.problem import Problem
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.space import SceneSpace
from risk_sac.scripts.motions import SIZE
from risk_sac.types import Floats

GRID = 65535  # of points in files
MOST_BYTES = 3_000_000
DATA = Path(str(files("risk_sac.prior"))) / "weights"


@dataclass(frozen=True, slots=True)
class Prior:
    """What was trained on a shipped family; its points are in the unit cube of that family's space, genes behind."""

    family: str
    model: ScriptModel
    library: Floats  # n x inputs; points that led to failures
    library_kinds: tuple[str, ...]  # n
    card: Mapping[str, object]


def write_prior(path: Path, prior: Prior) -> None:
    """Writes a prior as plain arrays."""
    names = {"kinds": prior.model.kinds, "egos": prior.model.egos, "library_kinds": prior.library_kinds}
    meta = {"family": prior.family, **names, **prior.card}
    arrays: dict[str, NDArray[np.float16] | NDArray[np.uint16] | NDArray[np.uint8]] = {
        "meta": np.frombuffer(json.dumps(meta).encode(), np.uint8),
        "library": np.round(prior.library * GRID).astype(np.uint16),
        **prior.model.arrays(),
    }
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]  # numpy's stub takes a name for `allow_pickle`


def read_prior(path: Path) -> Prior:
    """Reads what `write_prior` wrote; nothing is unpickled.

    Raises:
      ConfigError: the file is damaged, too large, or for scenes and scripts of another layout.
    """
    if path.stat().st_size > MOST_BYTES:
        raise ConfigError("prior", f"{path.name} of {path.stat().st_size} bytes", f"at most {MOST_BYTES}")
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
            meta = json.loads(arrays["meta"].tobytes())
            library = arrays["library"].astype(np.float64) / GRID
            model = ScriptModel.from_arrays(arrays, tuple(meta.pop("kinds")), tuple(meta.pop("egos")))
        family, kinds = meta.pop("family"), tuple(meta.pop("library_kinds"))
        wanted = inputs_of(family)
        if library.shape != (len(kinds), wanted) or model.inputs != wanted:
            raise ValueError(f"points of {model.inputs} and {library.shape[1:]} numbers, not {wanted}")
    except (ValueError, KeyError, EOFError, BadZipFile) as error:
        raise ConfigError(
            "prior", f"{path.name}: {error}", "what `risk-sac pretrain` writes, as this version"
        ) from error
    return Prior(family, model, library, kinds, meta)


def inputs_of(family: str) -> int:
    """Numbers of a point of a shipped family: scene parameters, then genes."""
    shipped = FAMILIES[family]
    return shipped.space.dimension + SIZE * len(shipped.adversaries)


@cache
def shipped_prior(family: str) -> Prior | None:
    """Returns the prior of a shipped family; None if it has none."""
    path = DATA / f"{family}.npz"
    return read_prior(path) if path.exists() else None


def prior_of(problem: Problem) -> Prior | None:
    """Returns the prior of a problem's pattern; None if there is none, or not for as many adversaries."""
    for name, shipped in FAMILIES.items():
        alike = (shipped.vehicles, shipped.pedestrians) == (problem.family.vehicles, problem.family.pedestrians)
        if alike and set(shipped.space.names) <= set(problem.space.names):
            return shipped_prior(name)
    return None


class Translation:
    """Maps points of a problem onto those of a shipped family, by the scene parameters' names and values.

    Attributes:
      scene_size: scene parameters of the problem.
    """

    def __init__(self, problem: SceneSpace, shipped: SceneSpace) -> None:
        self.scene_size, self._shipped = problem.dimension, shipped.dimension
        self._places = [problem.names.index(name) for name in shipped.names]
        self._problem = problem.low, problem.high - problem.low
        self._known = shipped.low, shipped.high - shipped.low

    def known(self, points: Floats) -> Floats:
        """Translates points of the problem, `n x (d + genes)`."""
        low, width = self._problem
        values = (low + points[:, : self.scene_size] * width)[:, self._places]
        return np.concatenate([_unit(values, *self._known), points[:, self.scene_size :]], 1)

    def own(self, known: Floats) -> Floats:
        """Translates points of the shipped family; parameters that it lacks are put to their middle."""
        low, width = self._known
        scenes = np.full((len(known), self.scene_size), 0.5)
        own_low, own_width = self._problem
        values = low + known[:, : self._shipped] * width
        scenes[:, self._places] = _unit(values, own_low[self._places], own_width[self._places])
        return np.concatenate([scenes, known[:, self._shipped :]], 1)


def _unit(values: Floats, low: Floats, width: Floats) -> Floats:
    offset = values - low
    return np.clip(np.divide(offset, width, out=np.zeros_like(offset), where=width > 0), 0.0, 1.0)
