"""What a campaign found as JUnit XML, which CI systems show: a suite per family, a case per run. Pure."""

from collections.abc import Mapping, Sequence

from junitparser import Error, Failure, Skipped
from junitparser.junitparser import FinalResult
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite

from risk_sac.cli.campaigns.gate import Bounds, exceeded
from risk_sac.cli.text import printable
from risk_sac.client import Metrics, Results, RunResult


def junit(results: Results, url: str, bounds: Bounds, failures: Mapping[str, Sequence[str]]) -> JUnitXml:
    """The report of a campaign.

    A run has failed where a rate of its own lies above its bound, and is an error where it failed or was cancelled.

    Args:
      results: of the campaign.
      url: of the campaign, for whoever reads the report.
      bounds: on the rates of each run.
      failures: ids of the first failures of a run, by its id.
    """
    report = JUnitXml("risk-sac")
    for family in dict.fromkeys(run.family for run in results.runs):
        suite = TestSuite(family)
        runs = [run for run in results.runs if run.family == family]
        properties = {"campaign": results.campaign_id, "url": url, **_versions(runs)}
        for name, value in properties.items():
            suite.add_property(printable(name), printable(value))
        suite.add_testcases([_case(run, url, bounds, failures.get(run.id, ())) for run in runs])
        report.add_testsuite(suite)
    report.update_statistics()
    return report


def _case(run: RunResult, url: str, bounds: Bounds, failures: Sequence[str]) -> TestCase:
    case = TestCase(f"seed {run.seed}", printable(f"{run.family}.{run.method}"), round(run.busy_s, 3))
    for name, value in (("run", run.id), ("spec_digest", run.spec_digest), ("digest", run.digest)):
        if value is not None:
            case.add_property(name, printable(value))
    if run.metrics is not None:
        case.add_property("funnel", _funnel(run.metrics))
    result = _result(run, bounds)
    if result is not None:
        result.text = printable("\n".join(f"{url}/failures/{failure}" for failure in failures))
        case.append(result)
    return case


def _result(run: RunResult, bounds: Bounds) -> FinalResult | None:
    """None where all is fine."""
    if run.state in ("failed", "cancelled"):
        return Error(printable(f"{run.state}: {run.reason}" if run.reason else run.state), run.state)
    if run.state != "succeeded":
        return Skipped(f"{run.state}: its rates can still change")
    above = exceeded(run.metrics, bounds)
    if run.metrics is None or not above:
        return None
    counts = {"ECR": f"{run.metrics.failures} valid", "PCR": f"{run.metrics.preventable} preventable"}
    found = (
        f"{name} {above[name]:.3f} > {bound:g}: {counts[name]} failures in {run.metrics.episodes} episodes"
        for name, bound in bounds.items()
        if name in above
    )
    return Failure("; ".join(found), " ".join(above).lower())


def _funnel(metrics: Metrics) -> str:
    return (
        f"{metrics.raw_collisions} contacts, {metrics.failures} valid, {metrics.distinct_failures} distinct, "
        f"{metrics.distinct_preventable} preventable"
    )


def _versions(runs: Sequence[RunResult]) -> dict[str, str]:
    """Software that produced the results; more than one version of it where it was changed in between."""
    found: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, version in run.versions.items():
            found.setdefault(f"version.{name}", {})[version] = None
    return {name: ", ".join(versions) for name, versions in found.items()}
