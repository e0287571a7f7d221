"""Whether a campaign found more than it may have: what the exit status of a CI job says. Pure."""

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

from risk_sac.cli.console import ABOVE, COULD_NOT_RUN, OK
from risk_sac.cli.text import counted
from risk_sac.client import Results, Total
from risk_sac.errors import ConfigError
from risk_sac.metrics import wilson_interval

JudgedBy = Literal["interval", "rate"]
JUDGED_BY: tuple[JudgedBy, ...] = get_args(JudgedBy)
COUNTED = {"ECR": "valid failure", "PCR": "preventable failure"}


def rate(text: str) -> float:
    """A rate, from the command line."""
    value = float(text)
    if not math.isfinite(value) or not 0 <= value <= 1:
        raise argparse.ArgumentTypeError(f"got {text!r}; wanted a rate in [0, 1]")
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What the rates of every family and method, controls included, may be; None sets no bound."""

    ecr: float | None = None
    pcr: float | None = None
    judged_by: JudgedBy = "interval"

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Bounds":
        """Those of the command line.

        Raises:
          ConfigError: nothing could ever keep one.
        """
        bounds = cls(ecr=options.max_ecr, pcr=options.max_pcr, judged_by=options.judge_by)
        for name, bound in bounds.items():
            if bound == 0 and bounds.judged_by == "interval":
                message = "got 0, and the interval of no rate ends there; wanted more, or --judge-by rate as well"
                raise ConfigError(message, field=f"--max-{name.lower()}")
        return bounds

    def items(self) -> tuple[tuple[str, float], ...]:
        """Rate -> its bound, for those that have one."""
        both = (("ECR", self.ecr), ("PCR", self.pcr))
        return tuple((name, bound) for name, bound in both if bound is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A rate of one family and method beside its bound."""

    name: str  # ECR | PCR
    bound: float
    judged_by: JudgedBy
    rate: float
    upper: float  # end of its 95 % interval
    failures: int  # that the rate counts
    episodes: int

    @property
    def verdict(self) -> Literal["above", "may be above", "within"]:
        """How the rate lies to its bound; one that is equal is within."""
        if self.rate > self.bound:
            return "above"
        return "may be above" if self.judged_by == "interval" and self.upper > self.bound else "within"

    def __str__(self) -> str:
        interval = f", 95 % interval up to {self.upper:.3f}" if self.judged_by == "interval" else ""
        counts = f"{counted(self.failures, COUNTED[self.name])} in {counted(self.episodes, 'episode')}"
        return f"{self.rate:.3f}{interval} ({counts})"


def comparisons(total: Total, bounds: Bounds) -> Iterator[Comparison]:
    """The rates of a family and method that have a bound, and have been measured."""
    measured = {
        "ECR": (total.ecr, total.ecr_high, total.failures),
        "PCR": (total.pcr, total.pcr_high, total.preventable),
    }
    for name, bound in bounds.items():
        found, high, failures = measured[name]
        if found is None:
            continue
        # A bootstrap over few seeds ends at the worst of them: at 0 where none has failed, however short they were.
        upper = max(high or 0.0, wilson_interval(failures, total.episodes)[1])
        yield Comparison(
            name=name,
            bound=bound,
            judged_by=bounds.judged_by,
            rate=found,
            upper=upper,
            failures=failures,
            episodes=total.episodes,
        )


def verdict(results: Results, bounds: Bounds) -> tuple[int, str]:
    """The exit status, and why.

    Args:
      results: of a campaign, which counts as measured once it has succeeded.
      bounds: on the rates of every family and method.
    """
    if results.complete and results.state != "succeeded":
        return COULD_NOT_RUN, f"the campaign {_WORDS.get(results.state, results.state)}: not all of it was measured"
    if not bounds.items():
        return OK, ""
    if not results.complete:
        return COULD_NOT_RUN, f"the campaign is {results.state}, and its rates can still change; wait with `watch`"
    reasons: dict[str, list[str]] = {}
    for total in results.totals:
        for each in comparisons(total, bounds):
            said = f"{each.name} {each.verdict} {each.bound:g}"
            reasons.setdefault(said, []).append(f"{total.family} {total.method} {each}")
    passed = all(each.verdict == "within" for total in results.totals for each in comparisons(total, bounds))
    lines = [f"{said}: {', '.join(whose)}" for said, whose in reasons.items()]
    if any("may be above" in said for said in reasons):
        lines.append("More episodes narrow an interval; --judge-by rate ignores it.")
    return (OK if passed else ABOVE), "\n".join(lines)


_WORDS = {"failed": "failed", "cancelled": "was cancelled"}
