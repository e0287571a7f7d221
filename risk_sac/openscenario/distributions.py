"""Variation files: ranges, sets, value sets and distributions of a scenario's parameters.

Source: ASAM OpenSCENARIO XML 1.3, ParameterValueDistribution.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from risk_sac.config import distribution as laws
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.errors import ConfigError
from risk_sac.openscenario.parameters import WHOLE, Varied
from risk_sac.openscenario.scope import At, NameScope, text_of

MOST_ROWS = 10_000
MOST_POINTS = 100_000_000  # of the grid; choice
STOCHASTIC = (
    "ProbabilityDistributionSet",
    "NormalDistribution",
    "LogNormalDistribution",
    "UniformDistribution",
    "PoissonDistribution",
    "Histogram",
)
_USER = "UserDefinedDistribution"
_USER_EFFECT = "the parameter keeps its default value"
NO_SCOPE = NameScope(lambda name: None, list)


class Variation:
    """Reads what a variation file says of parameters."""

    def __init__(self, kinds: Mapping[str, str], remarks: list[str]) -> None:
        """Takes each parameter's type; unread distributions are added to `remarks`."""
        self._kinds, self._remarks = kinds, remarks

    def read(self, block: At) -> list[Varied]:
        """Reads the element `ParameterValueDistribution`; raises `ConfigError`, also for too large a grid."""
        varied = list[Varied]()
        for part in block.all("Deterministic"):
            for at in part.all("DeterministicSingleParameterDistribution"):
                varied += self._single(at)
            for at in part.all("DeterministicMultiParameterDistribution"):
                varied += self._several(at, sum(len(one.names) > 1 for one in varied))
        for part in block.all("Stochastic"):
            for name in ("numberOfTestRuns", "randomSeed"):
                part.number_or(name, 0.0)
            for at in part.all("StochasticDistribution"):
                varied += self._stochastic(at)
        _check(block, varied)
        return varied

    def _single(self, at: At) -> Iterator[Varied]:
        name = at.constant("parameterName")
        if (span := at.maybe("DistributionRange")) is not None:
            yield self._range(at, name, span)
        elif (texts := at.maybe("DistributionSet")) is not None:
            yield Varied(
                name, at.element, rows=_rows(at, name, [one.constant("value") for one in texts.all("Element")])
            )
        else:
            self._not_read(at)

    def _range(self, at: At, name: str, span: At) -> Varied:
        """A range with its step; of whole numbers a row for each."""
        low, high = _bounds(span.one("Range"))
        step = span.number("stepWidth")
        if not isinstance(step, float) or step <= 0.0:
            raise span.refusal(f"stepWidth {step}", "a number above 0")
        count = math.floor((high - low) / step + 1e-9) + 1
        if self._kinds.get(name) in WHOLE or count == 1:
            if count > MOST_ROWS:
                raise span.refusal(f"{count} whole numbers", f"at most {MOST_ROWS}", "take a greater stepWidth")
            return Varied(name, at.element, rows=_rows(at, name, [text_of(low + k * step) for k in range(count)]))
        return Varied(name, at.element, at.build(ScenarioParameter, range=(low, high), step=step))

    def _several(self, at: At, number: int) -> Iterator[Varied]:
        """Value sets, whose parameters vary together."""
        if (block := at.maybe("ValueSetDistribution")) is None:
            self._not_read(at)
            return
        rows = list[Mapping[str, str]]()
        for one in block.all("ParameterValueSet"):
            pairs = [(a.constant("parameterRef"), a.constant("value")) for a in one.all("ParameterAssignment")]
            row = dict(pairs)
            if len(row) < len(pairs):
                raise one.refusal("a parameter twice", "each parameter once")
            if rows and row.keys() != rows[0].keys():
                raise one.refusal(f"values of {', '.join(row)}"[:300], f"of {', '.join(rows[0])}"[:300])
            rows.append({name: row[name] for name in rows[0]} if rows else row)
        if not rows or not rows[0]:
            raise at.refusal("no values", "a ParameterValueSet with a ParameterAssignment")
        if len(rows) > MOST_ROWS:
            raise at.refusal(f"{len(rows)} value sets", f"at most {MOST_ROWS}")
        (name, *others) = rows[0]
        yield Varied(name if not others else f"value_sets_{number + 1}", at.element, rows=tuple(rows))

    def _stochastic(self, at: At) -> Iterator[Varied]:
        name = at.constant("parameterName")
        law = at.maybe(*STOCHASTIC)
        if law is None:
            self._not_read(at)
        elif law.tag == "ProbabilityDistributionSet":
            elements = law.all("Element")
            weights = tuple(one.number("weight") for one in elements)
            rows = _rows(at, name, [one.constant("value") for one in elements])
            yield Varied(name, at.element, rows=rows, weights=law.build(laws.WeightsLaw, weights=weights))
        else:
            of = _LAWS[law.tag](law)
            bounds = law.maybe("Range")
            low, high = _bounds(bounds) if bounds is not None else of.usual_range
            yield Varied(name, at.element, at.build(ScenarioParameter, range=(low, high), distribution=of))

    def _not_read(self, at: At) -> None:
        found = at.maybe(_USER)
        if found is None:
            tags = ", ".join(child.tag for child in at.element.children) or "nothing"
            raise at.refusal(tags[:200], "a distribution of OpenSCENARIO 1.3")
        found.element.use_all()
        self._remarks.append(f"{found.element.place}: not read; {_USER_EFFECT}")


def _rows(at: At, name: str, texts: Sequence[str]) -> tuple[Mapping[str, str], ...]:
    if not 0 < len(texts) <= MOST_ROWS:
        raise at.refusal(f"{len(texts)} values", f"1 to {MOST_ROWS}")
    return tuple({name: text} for text in texts)


def _bounds(at: At) -> tuple[float, float]:
    low, high = at.number("lowerLimit"), at.number("upperLimit")
    if not (isinstance(low, float) and isinstance(high, float) and low <= high):
        raise at.refusal(f"{low} to {high}", "numbers, the lower limit first")
    return low, high


def _uniform(at: At) -> laws.UniformLaw:
    low, high = _bounds(at.one("Range"))
    return at.build(laws.UniformLaw, low=low, high=high)


def _deviation(at: At) -> float:
    variance = at.number("variance")
    if not isinstance(variance, float) or variance <= 0.0:
        raise at.refusal(f"variance {variance}", "a number above 0")
    return math.sqrt(variance)


def _histogram(at: At) -> laws.HistogramLaw:
    bins = []
    for part in at.all("Bin"):
        low, high = _bounds(part.one("Range"))
        bins.append(part.build(laws.HistogramBin, low=low, high=high, weight=part.number("weight")))
    return at.build(laws.HistogramLaw, bins=tuple(sorted(bins, key=lambda part: part.low)))


_LAWS: Mapping[str, Callable[[At], Any]] = {
    "UniformDistribution": _uniform,
    "NormalDistribution": lambda at: at.build(
        laws.NormalLaw, mean=at.number("expectedValue"), deviation=_deviation(at)
    ),
    "LogNormalDistribution": lambda at: at.build(  # mean and variance of the logarithm
        laws.LognormalLaw, log_mean=at.number("expectedValue"), log_deviation=_deviation(at)
    ),
    "PoissonDistribution": lambda at: at.build(laws.PoissonLaw, expected=at.number("expectedValue")),
    "Histogram": _histogram,
}


def _check(block: At, varied: Sequence[Varied]) -> None:
    """Refuses duplicate parameters and a grid of too many points."""
    names, points = set[str](), 1
    for part in varied:
        for name in part.names:
            if name in names:
                raise ConfigError(part.place.place, f"the parameter {name[:80]!r} once more", "each parameter once")
            names.add(name)
        points *= points_of(part)
    if points > MOST_POINTS:
        raise block.refusal(f"a grid of {points:.3g} points", f"at most {MOST_POINTS:.0e}", "take greater steps")


def points_of(part: Varied) -> int:
    """Returns an axis's number of grid points; 1 without a step."""
    if part.parameter is None or part.parameter.range is None:
        return len(part.rows) or 1
    low, high = part.parameter.range
    return 1 if part.parameter.step is None else math.floor((high - low) / part.parameter.step + 1e-9) + 1
