"""Writes the results of a campaign as JUnit XML: a suite per family, a case per run. Pure.

Each family and method has a case for each requirement that counts or has a bound. Where there are other bounds, it has
one more. These cases fail as the exit status does.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from junitparser import Error, Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite

from risk_sac.cli.campaigns.failures import look_command
from risk_sac.cli.campaigns.gate import BoundCheck, GateBounds, Measured, comparisons, excesses, measured
from risk_sac.cli.console import counted, headline
from risk_sac.client import Episode, Results, RunResult, Total
from risk_sac.host.terminal import printable
from risk_sac.metrics import COLUMNS, requirement_cells
from risk_sac.records import State


def junit(
    results: Results, service_url: str, url: str, bounds: GateBounds, failures: Mapping[str, Sequence[Episode]]
) -> JUnitXml:
    """Write the report of a campaign; `failures` has the first failures of a run by its id.

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
    """A case for each requirement of a family and method that counts or has a bound."""
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
    """Whether a family and method keeps the bounds that are of no single requirement, over all its runs."""
    case = TestCase("all seeds", printable(f"{total.family}.{total.method}"))
    named = names.of_method(total.family, total.method)
    _judge(case, list(comparisons(total, bounds)), list(excesses(total, bounds)), names.state, named)
    return case


def _judge(case: TestCase, found: Sequence[BoundCheck], exceeded: Sequence[str], state: State, named: str) -> None:
    """Fails a case whose rate or count is beyond its bound; `named` has its failures."""
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


@dataclass(frozen=True, slots=True)
class Names:
    """Failures of a campaign in words, each with the command that shows it."""

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
        """Those of the first failures that violate a requirement, and the command that lists all."""
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
    """Software that produced the results; more than one version of it where it was changed in between."""
    versions_by_name: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, version in run.versions.items():
            versions_by_name.setdefault(f"version.{name}", {})[version] = None
    return {name: ", ".join(versions) for name, versions in versions_by_name.items()}
