"""Parts of a campaign's report as the service answers them: table, clusters, figures, evidence. Pure."""

import shlex
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from io import BytesIO
from typing import Annotated, Literal

from pydantic import Field

from risk_sac.benchmark.power import played_by, power_of
from risk_sac.config import FamilyName
from risk_sac.failures.cases import Regression
from risk_sac.failures.clusters import Overview
from risk_sac.records import Record
from risk_sac.report import Comparison, FinishedRun, table_csv, table_json, table_markdown
from risk_sac.report.document import Origin, report_page
from risk_sac.report.evidence import gathered
from risk_sac.report.figures import FORMATS, Format
from service.views.reports import CampaignReport

MEDIA_TYPES = {
    "json": "application/json",
    "html": "text/html",
    "md": "text/markdown",
    "csv": "text/csv",
    "yaml": "application/yaml",
    "png": "image/png",
    "svg": "image/svg+xml",
}
TABLES: dict[str, Callable[[Comparison], str]] = {"json": table_json, "md": table_markdown, "csv": table_csv}


class Clusters(Record):
    """Failures of the finished runs by kind, without flaky ones."""

    complete: bool
    """Whether all runs are in them."""
    families: Mapping[FamilyName, Overview]
    """Those with a finished run."""


class FigureFile(Record):
    """A figure in one format."""

    format: Literal["png", "svg"]
    media_type: Annotated[str, Field(examples=["image/svg+xml"])]
    href: Annotated[str, Field(examples=["/v1/campaigns/ca39e56a9cd896b07/figures/ecr_low.svg"])]
    """Path of the file."""


class Figure(Record):
    """A figure of the report."""

    name: Annotated[str, Field(examples=["ecr_low", "bars_rho_c_evaluation"])]
    """`ecr_`, `pcr_`, `lambda_`, `alpha_`: curves over a family's search; `preventable_found_`, `distinct_found_`: what
    was found over processor time; `times_`: from release to conflict and contact. `bars_`: a metric of all families."""
    files: list[FigureFile]


class Figures(Record):
    """The figures that the finished runs allow."""

    complete: bool
    """Whether all runs are in them."""
    items: list[Figure]
    """None before a run has finished."""


def clusters(made: CampaignReport) -> str:
    """Returns the kinds of failures as JSON."""
    body = Clusters(complete=not made.comparison.missing, families=made.comparison.overviews)
    return body.model_dump_json()


def table(made: CampaignReport, format_: str, base_url: str) -> str:
    """Returns the comparison in a format of `TABLES`."""
    return TABLES[format_](_with_commands(made, base_url))


def figures(made: CampaignReport, root_path: str) -> str:
    """Returns the figures' paths as JSON, each with the proxy's prefix."""
    items = [
        Figure(name=name, files=_files(f"{root_path}/v1/campaigns/{made.campaign_id}/figures/{name}"))
        for name in made.figures
    ]
    return Figures(complete=not made.comparison.missing, items=items).model_dump_json()


def drawn(made: CampaignReport, format_: Format) -> bytes:
    """Returns a zip of all figures in a format."""
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as files:
        for name in made.figures:
            files.writestr(name, made.figure(name, format_))
    return packed.getvalue()


def evidence(made: CampaignReport, format_: str, base_url: str, regression: Regression | None) -> str:
    """Returns bounds and coverage as JSON; as a page or Markdown with failures, limits and commands."""
    comparison = _with_commands(made, base_url)
    found = gathered(comparison)
    if format_ == "json":
        return found.model_dump_json()
    here = f"{base_url}v1/campaigns/{made.campaign_id}"

    def show(run: FinishedRun, failure: str) -> str:
        return shlex.join(["curl", "-s", f"{here}/failures/{failure}/picture.png", "-o", "failure.png"])

    posted = f'{{"campaign_id": "{made.campaign_id}", "ego": {{"profile": "careful"}}}}'
    origin = Origin(
        report=shlex.join(["curl", "-s", f"{here}/report?format={format_}", "-o", f"report.{format_}"]),
        data=shlex.join(["curl", "-s", f"{here}/report?format=json"]),
        show=show,
        regress=shlex.join(["curl", f"{base_url}v1/regressions", "-H", "content-type: application/json", "-d", posted]),
        folders=made.folders,
        regression=regression,
    )
    power = power_of(comparison.spec, played_by(comparison.runs))
    return report_page(comparison, found, origin, power, "html" if format_ == "html" else "markdown")


def _files(path: str) -> list[FigureFile]:
    return [FigureFile(format=each, media_type=MEDIA_TYPES[each], href=f"{path}.{each}") for each in FORMATS]


def _with_commands(made: CampaignReport, base_url: str) -> Comparison:
    """Adds the commands that queue the campaign again and that save its spec."""
    campaigns = f"{base_url}v1/campaigns"
    spec, post, as_yaml = map(
        shlex.quote,
        (f"{campaigns}/{made.campaign_id}/spec", campaigns, f"{campaigns}/{made.campaign_id}/spec?format=yaml"),
    )
    again = f"curl -s {spec} | curl {post} -H 'content-type: application/json' -d @-"
    return replace(made.comparison, command=again, spec_command=f"curl -s {as_yaml} -o spec.yaml")
