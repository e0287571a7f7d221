"""Parts of a scene parameter's range."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.space import Parameter
from risk_sac.types import Floats


@dataclass(frozen=True, slots=True)
class Axis:
    """A parameter and its bins; each holds its lower edge, the last one both."""

    parameter: Parameter
    names: tuple[str, ...]  # of the bins: a category, or a range in the parameter's unit
    edges: Floats  # inner ones, one fewer than bins

    def places(self, values: Floats) -> NDArray[np.int64]:
        """The bin of each value, `n`."""
        return np.searchsorted(self.edges, values, side="right").astype(np.int64)


def axis_of(parameter: Parameter, whole: Parameter, bins: int) -> Axis:
    """The bins of a parameter.

    Args:
      parameter: as the ODD bounds it.
      whole: the same as its family has it; its halves are its categories, if it has some.
      bins: of a number; a category is a bin, and a parameter that the ODD leaves no room is one.
    """
    if whole.categories:
        middle = (whole.low + whole.high) / 2  # belongs to the upper half
        left = parameter.low < middle, parameter.high >= middle
        names = tuple(name for name, allowed in zip(whole.categories, left, strict=True) if allowed)
        return Axis(parameter, names, np.array([middle] if all(left) else []))
    if parameter.high <= parameter.low:
        return Axis(parameter, (f"{parameter.low:g}",), np.array([]))
    edges = np.linspace(parameter.low, parameter.high, bins + 1)
    names = tuple(f"{low:.3g} to {high:.3g}" for low, high in pairwise(edges))
    return Axis(parameter, names, edges[1:-1])
