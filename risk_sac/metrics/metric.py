"""What a row of the metrics says: names, unit, formula, and how runs are pooled. Pure."""

from collections.abc import Callable
from dataclasses import dataclass

from risk_sac.metrics.counts import Counts, pooled_counts
from risk_sac.metrics.intervals import wilson_interval
from risk_sac.metrics.tally import Tally
from risk_sac.records import RunMetrics


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """A figure that `RunMetrics` keeps, since it follows from sums that only the tally has."""

    field: str  # of `RunMetrics`
    formula: Callable[[Tally], float | None]
    interval: bool = False  # whether `<field>_low` and `<field>_high` lie beside it

    def of(self, metrics: RunMetrics) -> float | None:
        """As it was kept."""
        value: float | None = getattr(metrics, self.field)
        return value


@dataclass(frozen=True, slots=True, kw_only=True)
class Derived:
    """A figure that follows from a run's counts whenever it is asked for."""

    formula: Callable[[Counts], float | None]

    def of(self, metrics: RunMetrics) -> float | None:
        """Computed anew."""
        return self.formula(pooled_counts([metrics]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A figure of each run; of several runs their mean, with a bootstrap interval over those that have a value."""

    name: str  # in `table.json`, `table.csv`, the API and names of figures
    symbol: str  # in tables
    meaning: str  # the formula in words
    figure: Kept | Derived
    words: str = ""  # before the symbol, where there is room
    unit: str = ""  # none: a pure number
    trials: Callable[[Counts], int] | None = None  # of a rate: one run has a Wilson interval over so many
    search_only: bool = False  # or of the evaluation as well
    tested: bool = True  # whether methods are compared by it
    tabled: bool = True  # whether the table of methods shows it

    @property
    def heading(self) -> str:
        """The symbol and, where there is one, the unit."""
        return f"{self.symbol}, {self.unit}" if self.unit else self.symbol

    def value(self, metrics: RunMetrics) -> float | None:
        """Its value for a run."""
        return self.figure.of(metrics)

    def interval(self, value: float, counts: Counts) -> tuple[float, float] | None:
        """Wilson's 95 % interval of one run's rate; None for what is no rate."""
        if self.trials is None:
            return None
        trials = self.trials(counts)
        return wilson_interval(round(value * trials), trials)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """A figure of counts; of several runs that of their sums, without an interval."""

    name: str
    symbol: str
    meaning: str
    formula: Callable[[Counts], float | None]
