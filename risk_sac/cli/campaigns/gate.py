"""Compares campaign results with a CI job's bounds; writes JUnit XML. Pure.

The report has a suite per family and a case per run. Each family and method has a case for each requirement that counts
or has a bound. Where there are other bounds, it has one more. These cases fail as the exit status does.
"""

import argparse
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple, get_args

from junitparser import Error, Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite
from pydantic import ValidationError

from risk_sac.cli.console import ABOVE, COULD_NOT_RUN, OK, counted, headline
from risk_sac.client import Episode, Results, RunResult, Total
from risk_sac.config import IID_METHODS
from risk_sac.config.base import read_text
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import printable
from risk_sac.metrics import COLUMNS, requirement_cells
from risk_sac.records import RequirementCounts, State

JudgedBy = Literal["interval", "rate"]
JUDGED_BY: tuple[JudgedBy, ...] = get_args(JudgedBy)


def named_rate(text: str) -> tuple[str, float]:
    """Parses an argument NAME=VALUE: a requirement and a bound of its rate."""
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
        """Position of the rate relative to its bound; equal is within."""
        if self.rate > self.bound:
            return "above"
        return "may be above" if self.judged_by == "interval" and self.upper > self.bound else "within"

    def __str__(self) -> str:
        interval = f", 95 % interval up to {self.upper:.3f}" if self.judged_by == "interval" else ""
        counts = f"{counted(self.hits, self.what)} in {counted(self.episodes, 'episode')}"
        return f"{self.rate:.3f}{interval} ({counts})"


def comparisons(total: Total, bounds: GateBounds) -> Iterator[BoundCheck]:
    """Yields bounded and measured ECR and PCR of a family and method."""
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
    """Requirements of a family and method: all searches, or an i.i.d. run."""

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
    """Returns requirements by family and method, of the i.i.d. phase last."""
    drawn = [(run, run.metrics) for run in results.runs if run.method in IID_METHODS and run.metrics is not None]
    return [
        *(Measured(each.family, each.method, each.rated, each.requirements) for each in results.totals),
        *(Measured(run.family, run.method, metrics.rated, metrics.requirements) for run, metrics in drawn),
    ]


def excesses(total: Total, bounds: GateBounds) -> Iterator[str]:
    """Yields the counts that exceed a family and method's bounds, in words."""
    if bounds.preventable is not None and total.distinct_preventable > bounds.preventable:
        found = counted(total.distinct_preventable, "distinct preventable failure")
        yield f"{found}, where {bounds.preventable} may be"
    if bounds.known is not None:
        for kind in sorted(total.kinds.keys() - bounds.known.get(total.family, frozenset())):
            yield f"a new kind of failure: {kind}"


def verdict(results: Results, bounds: GateBounds) -> tuple[int, str]:
    """Judges a campaign; returns exit status and reason.

    One that did not succeed counts as not measured.

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


def junit(
    results: Results, service_url: str, url: str, bounds: GateBounds, failures: Mapping[str, Sequence[Episode]]
) -> JUnitXml:
    """Returns a campaign's report; `failures` maps run ids to first failures.

    A run is an error where it failed or was cancelled, and names its failures whatever the bounds are.
    """
    names = Names(results, service_url, url, failures)
    report = JUnitXml("risk-sac")
    candidates = sum(total.headline_candidates for total in results.totals)
    headline_failures = headline(results.headline, candidates, results.headline_published)
    for family in dict.fromkeys(run.family for run in results.runs):
        suite = TestSuite(family)
        runs = [run for run in results.runs if run.family == family]
        properties = {
            "headline failures": headline_failures,
            "campaign": results.campaign_id,
            "url": url,
            **_versions(runs),
        }
        for name, value in properties.items():
            suite.add_property(printable(name), printable(value))
        suite.add_testcases([_case(run, names.of_run(run)) for run in runs])
        for group in measured(results):
            if group.family == family:
                suite.add_testcases(list(_requirements(group, bounds, names)))
        if bounds.overall:
            totals = [total for total in results.totals if total.family == family]
            suite.add_testcases([_gate(total, bounds, names) for total in totals])
        report.add_testsuite(suite)
    report.update_statistics()
    return report


def _case(run: RunResult, named: str) -> TestCase:
    case = TestCase(f"seed {run.seed}", printable(f"{run.family}.{run.method}"), round(run.busy_s, 3))
    for name, value in (("run", run.id), ("spec_digest", run.spec_digest), ("digest", run.digest)):
        if value is not None:
            case.add_property(name, printable(value))
    if (metrics := run.metrics) is not None:
        published = len(metrics.headline_kinds_published)
        funnel = (
            f"headline failures: {headline(metrics.headline, metrics.headline_candidates, published)}; "
            f"{counted(metrics.raw_collisions, 'contact')}, {metrics.collisions} valid; "
            f"{counted(metrics.failures, 'failure')}; {counted(metrics.distinct_failures, 'distinct violation')}, "
            f"{metrics.distinct_preventable} preventable, {metrics.distinct_published} of them by R157, FSM or RSS, "
            f"{metrics.headline_candidates} plausible and not minor, {metrics.implausible} implausible"
        )
        case.add_property("funnel", funnel)
    if named:
        case.system_out = named
    if run.state in ("failed", "cancelled"):
        case.append(Error(printable(f"{run.state}: {run.reason}" if run.reason else run.state), run.state))
    elif run.state != "succeeded":
        case.append(Skipped(f"{run.state}: its rates can still change"))
    return case


def _requirements(group: Measured, bounds: GateBounds, names: "Names") -> Iterator[TestCase]:
    """Yields a case for each requirement that counts or has a bound."""
    compared = {each.name: each for each in group.comparisons(bounds)}
    for name, requirement in group.requirements.items():
        if requirement.counts != "failure" and name not in compared:
            continue
        case = TestCase(name, printable(f"{group.family}.{group.method}"))
        steps = zip(COLUMNS[2:], requirement_cells(name, requirement)[2:], strict=True)
        case.add_property("funnel", ", ".join(f"{step} {count}" for step, count in steps))
        own = [compared[name]] if name in compared else []
        _judge(case, own, [], names.state, names.of_requirement(group, name))
        yield case


def _gate(total: Total, bounds: GateBounds, names: "Names") -> TestCase:
    """Returns a case for bounds on ECR, PCR and counts, all runs."""
    case = TestCase("all seeds", printable(f"{total.family}.{total.method}"))
    named = names.of_method(total.family, total.method)
    _judge(case, list(comparisons(total, bounds)), list(excesses(total, bounds)), names.state, named)
    return case


def _judge(case: TestCase, found: Sequence[BoundCheck], exceeded: Sequence[str], state: State, named: str) -> None:
    """Fails a case beyond its bounds; `named` lists its failures."""
    broken = [each for each in found if each.verdict != "within"]
    said = "; ".join([*(f"{each.name} {each.verdict} {each.bound:g}: {each}" for each in broken or found), *exceeded])
    if state != "succeeded":
        case.append(Skipped(f"the campaign is {state}: not all of it was measured"))
    elif broken or exceeded:
        failure = Failure(said, " ".join([each.name.lower() for each in broken] + (["failures"] if exceeded else [])))
        failure.text = named
        case.append(failure)
    elif said:
        case.system_out = said


def look_command(service_url: str, campaign_id: str, failure_id: str) -> str:
    """Returns the command that shows a failure."""
    return f"risk-sac campaigns failures show {campaign_id} {failure_id} --url {service_url}"


@dataclass(frozen=True, slots=True)
class Names:
    """Failures of a campaign in words, each with its show command."""

    results: Results
    service_url: str
    url: str  # of the campaign
    failures: Mapping[str, Sequence[Episode]]  # the first ones, by run

    @property
    def state(self) -> State:
        """The campaign's."""
        return self.results.state

    def of_run(self, run: RunResult) -> str:
        """The first failures of a run; nothing without any."""
        failures = self.failures.get(run.id, ())
        if not failures or run.metrics is None:
            return ""
        lines = [f"{run.id}: {counted(run.metrics.failures, 'valid failure')}, of which the first {len(failures)}:"]
        for failure in failures:
            lines += self._of_failure(failure)
        pick = f"--scenario {run.family} --method {run.method} --seed {run.seed} --out {run.id}"
        lines.append(f"To have them again without the service: save {self.url}/spec?format=yaml as spec.yaml, then")
        lines.append(f"  risk-sac run --spec spec.yaml {pick}")
        return printable("\n".join(lines))

    def of_method(self, family: str, method: str) -> str:
        """The first failures of each run of a family and method."""
        runs = (run for run in self.results.runs if (run.family, run.method) == (family, method))
        return "\n\n".join(named for run in runs if (named := self.of_run(run)))

    def of_requirement(self, group: Measured, requirement: str) -> str:
        """Lists first failures that violate a requirement, and a command for all."""
        lines = [
            line
            for run in self.results.runs
            if (run.family, run.method) == (group.family, group.method)
            for failure in self.failures.get(run.id, ())
            if requirement in {each.requirement for each in failure.valid_violations}
            for line in self._of_failure(failure)
        ]
        listed = f"risk-sac campaigns failures list {self.results.campaign_id} --requirement {requirement}"
        return printable("\n".join([*lines, f"All: {listed} --url {self.service_url}"]))

    def _of_failure(self, failure: Episode) -> list[str]:
        worst = failure.worst_violation
        kind = "no violation" if worst is None else f"{worst.kind}; grade {worst.graded}"
        return [f"{failure.id}: {kind}", f"  {look_command(self.service_url, self.results.campaign_id, failure.id)}"]


def _versions(runs: Sequence[RunResult]) -> dict[str, str]:
    """Returns the software of the results, with several versions if changed meanwhile."""
    versions_by_name: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, version in run.versions.items():
            versions_by_name.setdefault(f"version.{name}", {})[version] = None
    return {name: ", ".join(versions) for name, versions in versions_by_name.items()}
