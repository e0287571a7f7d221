"""What a campaign found as JUnit XML, which CI systems show: a suite per family, a case per run. Pure."""

from collections.abc import Mapping, Sequence

from junitparser import Error, Failure, Skipped
from junitparser.junitparser import FinalResult
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite

from risk_sac.cli.campaigns.gate import exceeds
from risk_sac.cli.text import printable
from risk_sac.client import Results, RunResult


def junit(results: Results, url: str, max_ecr: float | None, failures: Mapping[str, Sequence[str]]) -> JUnitXml:
    """The report of a campaign.

    A run has failed where its own ECR lies above the bound, and is an error where it failed or was cancelled.

    Args:
      results: of the campaign.
      url: of the campaign, for whoever reads the report.
      max_ecr: bound on the ECR of each run; None sets none.
      failures: ids of the first failures of a run, by its id.
    """
    report = JUnitXml("risk-sac")
    for family in dict.fromkeys(run.family for run in results.runs):
        suite = TestSuite(family)
        runs = [run for run in results.runs if run.family == family]
        properties = {"campaign": results.campaign_id, "url": url, **_versions(runs)}
        for name, value in properties.items():
            suite.add_property(printable(name), printable(value))
        suite.add_testcases([_case(run, url, max_ecr, failures.get(run.id, ())) for run in runs])
        report.add_testsuite(suite)
    report.update_statistics()
    return report


def _case(run: RunResult, url: str, max_ecr: float | None, failures: Sequence[str]) -> TestCase:
    case = TestCase(f"seed {run.seed}", printable(f"{run.family}.{run.method}"), round(run.busy_s, 3))
    for name, value in (("run", run.id), ("spec_digest", run.spec_digest), ("digest", run.digest)):
        if value is not None:
            case.add_property(name, printable(value))
    result = _result(run, max_ecr)
    if result is not None:
        result.text = printable("\n".join(f"{url}/failures/{failure}" for failure in failures))
        case.append(result)
    return case


def _result(run: RunResult, max_ecr: float | None) -> FinalResult | None:
    """None where all is fine."""
    if run.state in ("failed", "cancelled"):
        return Error(printable(f"{run.state}: {run.reason}" if run.reason else run.state), run.state)
    if run.state != "succeeded":
        return Skipped(f"{run.state}: its ECR can still change")
    if run.metrics is not None and exceeds(run.metrics, max_ecr):
        found = f"{run.metrics.failures} valid failures in {run.metrics.episodes} episodes"
        return Failure(f"ECR {run.metrics.ecr:.3f} > {max_ecr:g}: {found}", "ecr")
    return None


def _versions(runs: Sequence[RunResult]) -> dict[str, str]:
    """Software that produced the results; more than one version of it where it was changed in between."""
    found: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, version in run.versions.items():
            found.setdefault(f"version.{name}", {})[version] = None
    return {name: ", ".join(versions) for name, versions in found.items()}
