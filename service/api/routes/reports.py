"""/v1/campaigns/{id}/table, figures, clusters and spec: the report of `risk-sac evaluate`.

Sync routes, so that statistics and drawing take place in FastAPI's thread pool.
"""

import shlex
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from risk_sac.config import CampaignSpec, FamilyName
from risk_sac.config.spec_file import campaign_yaml
from risk_sac.failures.clusters import Overview
from risk_sac.records import Record
from risk_sac.report import Comparison, table_csv, table_json, table_markdown
from risk_sac.report.figures import FORMATS, Format
from risk_sac.report.files import Table
from service.api.answers.representations import accepted, cacheable, link
from service.api.answers.responses import INVALID, STORAGE, TAGGED, UNACCEPTABLE, UNKNOWN, Responses
from service.api.context import AskedCampaign, Context, Service
from service.store.stored import StoredCampaign
from service.views.reports import CampaignReport


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


TableFormat = Literal["json", "md", "csv"]
SpecFormat = Literal["json", "yaml"]
FOR_BROWSERS = Query(alias="format", description="Instead of the Accept header, for a browser.")
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
SPECS: dict[str, Callable[[CampaignSpec], str]] = {"json": CampaignSpec.model_dump_json, "yaml": campaign_yaml}
BY_ACCEPT = {"Vary": "Accept"}

CACHED = {
    "ETag": {
        "description": "Changes whenever the body does; absent where the folder of a finished run cannot be read.",
        "schema": {"type": "string"},
    },
    "Cache-Control": TAGGED[200]["headers"]["Cache-Control"],
}
UNCHANGED: Responses = {304: {"description": "What If-None-Match names still holds", "headers": CACHED}}


def text(**examples: str) -> dict[str, Any]:
    """An answer in several formats of text, with an example of each."""
    content = {MEDIA_TYPES[name]: {"schema": {"type": "string"}, "example": text} for name, text in examples.items()}
    return {"headers": CACHED, "content": content}


TABLE: Responses = {
    200: text(
        md="# Comparison of methods\n\n…\n\n## low, search\n\n| method | seeds | ECR | …",
        csv="family,method,phase,runs,episodes,failures,…\nlow,random,search,2,80,3,…",
    )
}
SPEC: Responses = {
    200: {
        "content": {
            MEDIA_TYPES["yaml"]: {
                "schema": {"$ref": "#/components/schemas/CampaignSpec"},
                "example": {"label": "", "families": ["low"]},
            }
        }
    }
}
FIGURES: Responses = {200: {"headers": CACHED}}
FIGURE: Responses = {200: {"headers": CACHED, "content": {MEDIA_TYPES[each]: {} for each in FORMATS}}}

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["reports"], responses=STORAGE | INVALID | UNKNOWN)


@router.get("/table", response_model=Table, responses=TABLE | UNCHANGED | UNACCEPTABLE)
def get_table(
    request: Request,
    service: Service,
    campaign: AskedCampaign,
    format_: Annotated[TableFormat | None, FOR_BROWSERS] = None,
) -> Response:
    """Comparison of methods over the seeds of finished runs; names the missing runs."""
    name = chosen(request, format_, TABLES)
    report, headers = reported(request, service, campaign, name, others=BY_ACCEPT)
    command, spec_command = commands(request, campaign.id)
    comparison = replace(report.comparison, command=command, spec_command=spec_command)
    return Response(TABLES[name](comparison), headers=headers, media_type=MEDIA_TYPES[name])


@router.get("/clusters", response_model=Clusters, responses=FIGURES | UNCHANGED)
def get_clusters(request: Request, service: Service, campaign: AskedCampaign) -> Response:
    """Kinds of failures that the finished runs found, in words, with an example of each."""
    report, headers = reported(request, service, campaign, "clusters")
    body = Clusters(complete=not report.comparison.missing, families=report.comparison.overviews)
    return Response(body.model_dump_json(), headers=headers, media_type=MEDIA_TYPES["json"])


@router.get("/figures", response_model=Figures, responses=FIGURES | UNCHANGED)
def list_figures(request: Request, service: Service, campaign: AskedCampaign) -> Response:
    """Figures of the finished runs: search, results, λ and α."""
    report, headers = reported(request, service, campaign, "figures")
    items = [Figure(name=name, files=_files(request, campaign.id, name)) for name in report.figures]
    body = Figures(complete=not report.comparison.missing, items=items)
    return Response(body.model_dump_json(), headers=headers, media_type=MEDIA_TYPES["json"])


@router.get("/figures/{name}.{format}", response_class=Response, responses=FIGURE | UNCHANGED)
def get_figure(name: str, format: Format, request: Request, service: Service, campaign: AskedCampaign) -> Response:
    """One figure, drawn on demand and again once more runs have finished."""
    report, headers = reported(request, service, campaign, name, format)
    return Response(report.figure(name, format), headers=headers, media_type=MEDIA_TYPES[format])


@router.get("/spec", response_model=CampaignSpec, responses=SPEC | UNACCEPTABLE)
def get_spec(
    request: Request, campaign: AskedCampaign, format_: Annotated[SpecFormat | None, FOR_BROWSERS] = None
) -> Response:
    """Spec of the campaign: JSON to post again, or YAML for `risk-sac run --spec` and `risk-sac evaluate --spec`."""
    name = chosen(request, format_, SPECS)
    return Response(SPECS[name](campaign.spec), headers=BY_ACCEPT, media_type=MEDIA_TYPES[name])


def chosen(request: Request, given: str | None, offered: Iterable[str]) -> str:
    """Returns the format of the query, or else of the Accept header; raises as `accepted`."""
    names = {MEDIA_TYPES[name]: name for name in offered}
    return given or names[accepted(", ".join(request.headers.getlist("accept")), list(names))]


def reported(
    request: Request, service: Context, campaign: StoredCampaign, *parts: str, others: Mapping[str, str] = {}
) -> tuple[CampaignReport, dict[str, str]]:
    """Returns the report and the headers of its answer; arguments and errors as in `cacheable`."""
    headers = cacheable(request, service.reports.edition(campaign), *parts, others=others)
    report = service.reports.report(campaign)
    if not report.lasting:
        del headers["ETag"]
    return report, headers


def _files(request: Request, campaign_id: str, name: str) -> list[FigureFile]:
    path = link(request, f"/v1/campaigns/{campaign_id}/figures/{name}")
    return [FigureFile(format=each, media_type=MEDIA_TYPES[each], href=f"{path}.{each}") for each in FORMATS]


def commands(request: Request, campaign_id: str) -> tuple[str, str]:
    """Returns the commands that queue the campaign again and that save its spec."""
    campaigns = f"{request.base_url}v1/campaigns"
    spec, post, as_yaml = map(
        shlex.quote, (f"{campaigns}/{campaign_id}/spec", campaigns, f"{campaigns}/{campaign_id}/spec?format=yaml")
    )
    again = f"curl -s {spec} | curl {post} -H 'content-type: application/json' -d @-"
    return again, f"curl -s {as_yaml} -o spec.yaml"
