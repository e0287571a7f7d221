"""Whether a campaign found more than it may have: what the exit status of a CI job says. Pure."""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from pydantic import ValidationError

from risk_sac.cli.console import ABOVE, COULD_NOT_RUN, OK, counted
from risk_sac.client import Results, Total
from risk_sac.config.text import read_text
from risk_sac.errors import ConfigError
from risk_sac.metrics import wilson_interval

JudgedBy = Literal["interval", "rate"]
JUDGED_BY: tuple[JudgedBy, ...] = get_args(JudgedBy)
COUNTED = {"ECR": "valid failure", "PCR": "preventable failure"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What the rates of every family and method, controls included, may be; None sets no bound."""

    ecr: float | None = None
    pcr: float | None = None
    preventable: int | None = None  # distinct ones
    known: Mapping[str, frozenset[str]] | None = None  # family → signatures of failures that are no news
    judged_by: JudgedBy = "interval"

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Bounds":
        """Those of the command line.

        Raises:
          ConfigError: nothing could ever keep one, or the file of known failures cannot be read.
        """
        bounds = cls(
            ecr=options.max_ecr,
            pcr=options.max_pcr,
            preventable=options.max_preventable,
            known=None if options.no_new_failures is None else _read_known(options.no_new_failures),
            judged_by=options.judge_by,
        )
        for name, bound in bounds.rates():
            if bound == 0 and bounds.judged_by == "interval":
                got, expected = "0, where the interval of no rate ends", "more, or --judge-by rate as well"
                raise ConfigError(f"--max-{name.lower()}", got, expected)
        return bounds

    def __bool__(self) -> bool:
        return any(bound is not None for bound in (self.ecr, self.pcr, self.preventable, self.known))

    def rates(self) -> tuple[tuple[str, float], ...]:
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
    for name, bound in bounds.rates():
        found, high, failures = measured[name]
        if found is None:
            continue
        # A bootstrap over few seeds ends at the worst of them: at 0 where none has failed, however short they were.
        driven = total.episodes - total.invalid
        upper = max(high or 0.0, wilson_interval(failures, driven)[1])
        yield Comparison(
            name=name,
            bound=bound,
            judged_by=bounds.judged_by,
            rate=found,
            upper=upper,
            failures=failures,
            episodes=driven,
        )


def excesses(total: Total, bounds: Bounds) -> Iterator[str]:
    """In words, what a family and method has found more of than it may, as it was counted."""
    if bounds.preventable is not None and total.distinct_preventable > bounds.preventable:
        found = counted(total.distinct_preventable, "distinct preventable failure")
        yield f"{found}, where {bounds.preventable} may be"
    if bounds.known is not None:
        for signature in sorted(total.signatures.keys() - bounds.known.get(total.family, frozenset())):
            yield f"a new kind of failure: {signature}"


def verdict(results: Results, bounds: Bounds) -> tuple[int, str]:
    """Judge a campaign, which counts as measured once it has succeeded: the exit status, and why."""
    if results.complete and results.state != "succeeded":
        ended = "was cancelled" if results.state == "cancelled" else results.state
        return COULD_NOT_RUN, f"the campaign {ended}: not all of it was measured"
    if not bounds:
        return OK, ""
    if not results.complete:
        return COULD_NOT_RUN, f"the campaign is {results.state}, and what it finds can still change; wait with `watch`"
    reasons: dict[str, list[str]] = {}
    verdicts = set()
    exceeded: list[str] = []
    for total in results.totals:
        name = f"{total.family} {total.method}"
        for each in comparisons(total, bounds):
            verdicts.add(each.verdict)
            reasons.setdefault(f"{each.name} {each.verdict} {each.bound:g}", []).append(f"{name} {each}")
        exceeded += (f"{name}: {said}" for said in excesses(total, bounds))
    lines = [*(f"{said}: {', '.join(whose)}" for said, whose in reasons.items()), *exceeded]
    if "may be above" in verdicts:
        lines.append("More episodes narrow an interval; --judge-by rate ignores it.")
    return (OK if verdicts <= {"within"} and not exceeded else ABOVE), "\n".join(lines)


def _read_known(file: Path) -> Mapping[str, frozenset[str]]:
    """The kinds of failures of an earlier campaign, by family."""
    try:
        earlier = Results.model_validate_json(read_text(file, "--no-new-failures"))
    except ValidationError as error:
        expected = "what `risk-sac campaigns results ID --json` printed of an earlier campaign"
        raise ConfigError("--no-new-failures", str(file), expected) from error
    known: dict[str, frozenset[str]] = {}
    for total in earlier.totals:
        known[total.family] = known.get(total.family, frozenset()) | total.signatures.keys()
    return known
