"""Whether a campaign found more than it may have: what the exit status of a CI job says. Pure."""

import argparse
import math

from risk_sac.cli.console import ABOVE, COULD_NOT_RUN, OK
from risk_sac.client import Metrics, Results, Total


def rate(text: str) -> float:
    """A rate, from the command line."""
    value = float(text)
    if not math.isfinite(value) or not 0 <= value <= 1:
        raise argparse.ArgumentTypeError(f"got {text!r}; wanted a rate in [0, 1]")
    return value


def exceeds(measured: Total | Metrics | None, max_ecr: float | None) -> bool:
    """Whether an ECR lies above the bound: the ECR itself, whatever its interval; one that is equal does not."""
    return measured is not None and max_ecr is not None and measured.ecr is not None and measured.ecr > max_ecr


def verdict(results: Results, max_ecr: float | None) -> tuple[int, str]:
    """The exit status, and what to say about it.

    Args:
      results: of a campaign, which counts as measured once it has succeeded.
      max_ecr: bound on the ECR of every family and method, controls included; None sets none.
    """
    if results.complete and results.state != "succeeded":
        return COULD_NOT_RUN, f"the campaign {_WORDS.get(results.state, results.state)}: not all of it was measured"
    if max_ecr is None:
        return OK, ""
    if not results.complete:
        return COULD_NOT_RUN, f"the campaign is {results.state}, and its ECR can still change; wait with `watch`"
    above = [total for total in results.totals if exceeds(total, max_ecr)]
    found = ", ".join(f"{total.family} {total.method} {total.ecr:.3f}" for total in above)
    return (ABOVE, f"ECR above {max_ecr:g}: {found}") if above else (OK, "")


_WORDS = {"failed": "failed", "cancelled": "was cancelled"}
