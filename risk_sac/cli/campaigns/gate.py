"""Compares a campaign's results with the bounds of a CI job. Pure."""

import argparse
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple, get_args

from pydantic import ValidationError

from risk_sac.cli.console import ABOVE, COULD_NOT_RUN, OK, counted
from risk_sac.client import Results, Total
from risk_sac.config import IID_METHODS
from risk_sac.config.base import read_text
from risk_sac.errors import ConfigError
from risk_sac.records import RequirementCounts

JudgedBy = Literal["interval", "rate"]
JUDGED_BY: tuple[JudgedBy, ...] = get_args(JudgedBy)


def named_rate(text: str) -> tuple[str, float]:
    """Type of an argument NAME=VALUE: a requirement, and what its rate may be."""
    name, _, value = text.partition("=")
    try:
        bound = float(value)
    except ValueError:
        bound = -1.0
    if not name or not 0.0 <= bound <= 1.0:
        raise argparse.ArgumentTypeError(
            f"got {text!r}; wanted a requirement's name and a rate from 0 to 1, such as no_contact=0.05"
        )
    return name, bound


@dataclass(frozen=True, slots=True, kw_only=True)
class GateBounds:
    """Bounds of every family and method, controls included; None sets no bound."""

    ecr: float | None = None
    pcr: float | None = None
    requirements: Mapping[str, float] = field(default_factory=dict)  # by name; of runs of the i.i.d. phase as well
    preventable: int | None = None  # distinct ones
    known: Mapping[str, frozenset[str]] | None = None  # family → kinds of failures that are no news
    judged_by: JudgedBy = "interval"

    @classmethod
    def of(cls, options: argparse.Namespace) -> "GateBounds":
        """Those of the command line.

        Raises:
          ConfigError: nothing could ever keep one, or the file of known failures cannot be read.
        """
        bounds = cls(
            ecr=options.max_ecr,
            pcr=options.max_pcr,
            requirements=dict(options.max_rate or ()),
            preventable=options.max_preventable,
            known=None if options.no_new_failures is None else _read_known(options.no_new_failures),
            judged_by=options.judge_by,
        )
        named = [(f"--max-{name.lower()}", bound) for name, bound in bounds.rates()]
        named += [("--max-rate", bound) for bound in bounds.requirements.values()]
        for flag, bound in named:
            if bound == 0 and bounds.judged_by == "interval":
                got, expected = "0, where the interval of no rate ends", "more, or --judge-by rate as well"
                raise ConfigError(flag, got, expected)
        return bounds

    def __bool__(self) -> bool:
        return self.overall or bool(self.requirements)

    @property
    def overall(self) -> bool:
        """Whether a bound is of no single requirement."""
        return any(bound is not None for bound in (self.ecr, self.pcr, self.preventable, self.known))

    def rates(self) -> tuple[tuple[str, float], ...]:
        """ECR and PCR with their bounds, if they have one."""
        both = (("ECR", self.ecr), ("PCR", self.pcr))
        return tuple((name, bound) for name, bound in both if bound is not None)

    def check_names(self, requirements: Collection[str]) -> None:
        """Raises a ConfigError if a bound is of no requirement among these."""
        for name in self.requirements:
            if name not in requirements:
                known = ", ".join(requirements) or "those of a campaign whose requirements were counted"
                raise ConfigError("--max-rate", f"the requirement {name!r}", f"one of {known}")


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundCheck:
    """A rate of one family and method beside its bound."""

    name: str  # ECR | PCR | a requirement
    bound: float
    judged_by: JudgedBy
    rate: float
    upper: float  # end of its 95 % interval
    hits: int  # episodes that the rate counts
    what: str  # happened in them
    episodes: int

    @property
    def verdict(self) -> Literal["above", "may be above", "within"]:
        """Position of the rate relative to its bound; an equal one is within."""
        if self.rate > self.bound:
            return "above"
        return "may be above" if self.judged_by == "interval" and self.upper > self.bound else "within"

    def __str__(self) -> str:
        interval = f", 95 % interval up to {self.upper:.3f}" if self.judged_by == "interval" else ""
        counts = f"{counted(self.hits, self.what)} in {counted(self.episodes, 'episode')}"
        return f"{self.rate:.3f}{interval} ({counts})"


def comparisons(total: Total, bounds: GateBounds) -> Iterator[BoundCheck]:
    """ECR and PCR of a family and method, where they have a bound and have been measured."""
    rates = {
        "ECR": (total.ecr, total.ecr_high, total.collisions, "valid contact"),
        "PCR": (total.pcr, total.pcr_high, total.preventable_collisions, "preventable contact"),
    }
    for name, bound in bounds.rates():
        rate, high, hits, what = rates[name]
        if rate is None:
            continue
        yield BoundCheck(
            name=name,
            bound=bound,
            judged_by=bounds.judged_by,
            rate=rate,
            upper=high if high is not None else 1.0,
            hits=hits,
            what=what,
            episodes=total.rated,
        )


class Measured(NamedTuple):
    """Requirements of a family and method, of all its searches or of its i.i.d. run."""

    family: str
    method: str
    rated: int  # episodes
    requirements: Mapping[str, RequirementCounts]

    def comparisons(self, bounds: GateBounds) -> Iterator[BoundCheck]:
        """The rates that have a bound."""
        for name, requirement in self.requirements.items():
            if name in bounds.requirements:
                yield BoundCheck(
                    name=name,
                    bound=bounds.requirements[name],
                    judged_by=bounds.judged_by,
                    rate=requirement.rate,
                    upper=requirement.rate_high,
                    hits=requirement.in_rate,
                    what="valid violation" if requirement.counts == "failure" else "violation",
                    episodes=self.rated,
                )


def measured(results: Results) -> list[Measured]:
    """The requirements of a campaign by family and method, those of the i.i.d. phase last."""
    drawn = [(run, run.metrics) for run in results.runs if run.method in IID_METHODS and run.metrics is not None]
    return [
        *(Measured(each.family, each.method, each.rated, each.requirements) for each in results.totals),
        *(Measured(run.family, run.method, metrics.rated, metrics.requirements) for run, metrics in drawn),
    ]


def excesses(total: Total, bounds: GateBounds) -> Iterator[str]:
    """In words, what a family and method has found more of than it may, as it was counted."""
    if bounds.preventable is not None and total.distinct_preventable > bounds.preventable:
        found = counted(total.distinct_preventable, "distinct preventable failure")
        yield f"{found}, where {bounds.preventable} may be"
    if bounds.known is not None:
        for kind in sorted(total.kinds.keys() - bounds.known.get(total.family, frozenset())):
            yield f"a new kind of failure: {kind}"


def verdict(results: Results, bounds: GateBounds) -> tuple[int, str]:
    """Judge a campaign, which counts as measured once it has succeeded: the exit status, and why.

    Raises:
      ConfigError: a bound is of a requirement that the campaign does not have.
    """
    if results.complete and results.state != "succeeded":
        ended = "was cancelled" if results.state == "cancelled" else results.state
        return COULD_NOT_RUN, f"the campaign {ended}: not all of it was measured"
    if not bounds:
        return OK, ""
    if not results.complete:
        return COULD_NOT_RUN, f"the campaign is {results.state}, and what it finds can still change; wait with `watch`"
    groups = measured(results)
    bounds.check_names(list(dict.fromkeys(name for group in groups for name in group.requirements)))
    checks = [(total.family, total.method, each) for total in results.totals for each in comparisons(total, bounds)]
    checks += [(group.family, group.method, each) for group in groups for each in group.comparisons(bounds)]
    reasons: dict[str, list[str]] = {}
    for family, method, each in checks:
        reasons.setdefault(f"{each.name} {each.verdict} {each.bound:g}", []).append(f"{family} {method} {each}")
    verdicts = {each.verdict for *_, each in checks}
    exceeded = [
        f"{total.family} {total.method}: {said}" for total in results.totals for said in excesses(total, bounds)
    ]
    lines = [*(f"{said}: {', '.join(whose)}" for said, whose in reasons.items()), *exceeded]
    if "may be above" in verdicts:
        lines.append("More episodes narrow an interval; --judge-by rate ignores it.")
    return (OK if verdicts <= {"within"} and not exceeded else ABOVE), "\n".join(lines)


def _read_known(file: Path) -> Mapping[str, frozenset[str]]:
    try:
        earlier = Results.model_validate_json(read_text(file, "--no-new-failures"))
    except ValidationError as error:
        expected = "what `risk-sac campaigns results ID --json` printed of an earlier campaign"
        raise ConfigError("--no-new-failures", str(file), expected) from error
    known: dict[str, frozenset[str]] = {}
    for total in earlier.totals:
        known[total.family] = known.get(total.family, frozenset()) | total.kinds.keys()
    return known
