"""What a campaign found as JUnit XML, which CI systems show: a suite per family, a case per run. Pure.

Where there are bounds, each family and method has one more case, which fails as the exit status does.
"""

from collections.abc import Mapping, Sequence

from junitparser import Error, Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite

from risk_sac.cli.campaigns.failures import look_command
from risk_sac.cli.campaigns.gate import Bounds, comparisons, excesses
from risk_sac.cli.console import counted
from risk_sac.client import Episode, Results, RunResult, Total
from risk_sac.terminal import printable


def junit(
    results: Results, service_url: str, url: str, bounds: Bounds, failures: Mapping[str, Sequence[Episode]]
) -> JUnitXml:
    """Write the report of a campaign; `failures` has the first failures of a run by its id.

    A run is an error where it failed or was cancelled, and names its failures whatever the bounds are.
    """
    named = {
        run.id: _named(run, service_url, url, results.campaign_id, failures.get(run.id, ())) for run in results.runs
    }
    report = JUnitXml("risk-sac")
    for family in dict.fromkeys(run.family for run in results.runs):
        suite = TestSuite(family)
        runs = [run for run in results.runs if run.family == family]
        properties = {"campaign": results.campaign_id, "url": url, **_versions(runs)}
        for name, value in properties.items():
            suite.add_property(printable(name), printable(value))
        suite.add_testcases([_case(run, named[run.id]) for run in runs])
        if bounds:
            totals = [total for total in results.totals if total.family == family]
            suite.add_testcases([_gate(total, results, bounds, named) for total in totals])
        report.add_testsuite(suite)
    report.update_statistics()
    return report


def _case(run: RunResult, named: str) -> TestCase:
    case = TestCase(f"seed {run.seed}", printable(f"{run.family}.{run.method}"), round(run.busy_s, 3))
    for name, value in (("run", run.id), ("spec_digest", run.spec_digest), ("digest", run.digest)):
        if value is not None:
            case.add_property(name, printable(value))
    if (found := run.metrics) is not None:
        funnel = (
            f"{counted(found.raw_collisions, 'contact')}, {found.failures} valid, {found.distinct_failures} distinct, "
            f"{found.distinct_preventable} preventable"
        )
        case.add_property("funnel", funnel)
    if named:
        case.system_out = named
    if run.state in ("failed", "cancelled"):
        case.append(Error(printable(f"{run.state}: {run.reason}" if run.reason else run.state), run.state))
    elif run.state != "succeeded":
        case.append(Skipped(f"{run.state}: its rates can still change"))
    return case


def _gate(total: Total, results: Results, bounds: Bounds, named: Mapping[str, str]) -> TestCase:
    """Whether a family and method keeps the bounds, over all its runs."""
    case = TestCase("all seeds", printable(f"{total.family}.{total.method}"))
    found = list(comparisons(total, bounds))
    broken = [each for each in found if each.verdict != "within"]
    exceeded = list(excesses(total, bounds))
    said = "; ".join([*(f"{each.name} {each.verdict} {each.bound:g}: {each}" for each in broken or found), *exceeded])
    if results.state != "succeeded":
        case.append(Skipped(f"the campaign is {results.state}: not all of it was measured"))
    elif broken or exceeded:
        kinds = [each.name.lower() for each in broken] + (["failures"] if exceeded else [])
        failure = Failure(said, " ".join(kinds))
        runs = (run for run in results.runs if (run.family, run.method) == (total.family, total.method))
        failure.text = "\n\n".join(named[run.id] for run in runs if named[run.id])
        case.append(failure)
    else:
        case.system_out = said
    return case


def _named(run: RunResult, service_url: str, url: str, campaign_id: str, failures: Sequence[Episode]) -> str:
    """The first failures of a run, each with how to look at it, and how to have them all again."""
    if not failures or run.metrics is None:
        return ""
    lines = [f"{run.id}: {counted(run.metrics.failures, 'valid failure')}, of which the first {len(failures)}:"]
    for failure in failures:
        judgement = failure.collision and failure.collision.judgement
        kind = f"{judgement.signature}; grade {judgement.grade}" if judgement else "not judged"
        lines += [f"{failure.id}: {kind}", f"  {look_command(service_url, campaign_id, failure.id)}"]
    pick = f"--family {run.family} --method {run.method} --seed {run.seed} --out {run.id}"
    lines.append(f"To have them again without the service: save {url}/spec?format=yaml as spec.yaml, then")
    lines.append(f"  risk-sac run --spec spec.yaml {pick}")
    return printable("\n".join(lines))


def _versions(runs: Sequence[RunResult]) -> dict[str, str]:
    """Software that produced the results; more than one version of it where it was changed in between."""
    found: dict[str, dict[str, None]] = {}
    for run in runs:
        for name, version in run.versions.items():
            found.setdefault(f"version.{name}", {})[version] = None
    return {name: ", ".join(versions) for name, versions in found.items()}
