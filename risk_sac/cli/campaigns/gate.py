"""Whether a campaign found more than it may have: what the exit status of a CI job says. Pure."""

import argparse
import math
from dataclasses import dataclass

from risk_sac.cli.console import ABOVE, COULD_NOT_RUN, OK
from risk_sac.client import Metrics, Results, Total


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

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Bounds":
        """Those of the command line."""
        return cls(ecr=options.max_ecr, pcr=options.max_pcr)

    def items(self) -> tuple[tuple[str, float], ...]:
        """Rate -> its bound, for those that have one."""
        both = (("ECR", self.ecr), ("PCR", self.pcr))
        return tuple((name, bound) for name, bound in both if bound is not None)


def measured_rate(measured: Total | Metrics, name: str) -> float | None:
    """The ECR or the PCR."""
    return measured.ecr if name == "ECR" else measured.pcr


def exceeded(measured: Total | Metrics | None, bounds: Bounds) -> dict[str, float]:
    """Rates above their bounds: the rate itself, whatever its interval; one that is equal is not above."""
    if measured is None:
        return {}
    rates = {name: (measured_rate(measured, name), bound) for name, bound in bounds.items()}
    return {name: rate for name, (rate, bound) in rates.items() if rate is not None and rate > bound}


def verdict(results: Results, bounds: Bounds) -> tuple[int, str]:
    """The exit status, and what to say about it.

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
    complaints = [
        f"{name} above {bound:g}: "
        + ", ".join(f"{total.family} {total.method} {found[name]:.3f}" for total, found in above)
        for name, bound in bounds.items()
        if (above := [(total, found) for total in results.totals if name in (found := exceeded(total, bounds))])
    ]
    return (ABOVE, "; ".join(complaints)) if complaints else (OK, "")


_WORDS = {"failed": "failed", "cancelled": "was cancelled"}
