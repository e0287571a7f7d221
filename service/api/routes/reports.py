"""/v1/campaigns/{id}/table and figures: the report that `risk-sac evaluate` writes; and the spec to have it again.

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
from service.api.answers.representations import accepted_format, caching, entity_tag, has, not_modified
from service.api.answers.responses import INVALID, STORAGE, TAGGED, UNACCEPTABLE, UNKNOWN, Responses
from service.api.context import Context, CurrentCaller, Service
from service.store.stored import StoredCampaign
from service.views.reports import CampaignReport


class Clusters(Record):
    """The failures of the finished runs, sorted into kinds; flaky ones are left out."""

    complete: bool
    """Whether all runs are in them."""
    families: Mapping[FamilyName, Overview]
    """Those with a finished run."""


class FigureFile(Record):
    """A figure in one format."""

    format: Literal["png", "svg"]
    media_type: Annotated[str, Field(examples=["image/svg+xml"])]
    href: Annotated[str, Field(examples=["/v1/campaigns/ca39e56a9cd896b07/figures/ecr_low.svg"])]
    """Where it is."""


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
MEDIA_TYPES = {"json": "application/json", "md": "text/markdown", "csv": "text/csv", "yaml": "application/yaml"}
IMAGE_TYPES: dict[Format, str] = {"png": "image/png", "svg": "image/svg+xml"}
TABLES: dict[str, Callable[[Comparison], str]] = {"json": table_json, "md": table_markdown, "csv": table_csv}
SPECS: dict[str, Callable[[CampaignSpec], str]] = {"json": CampaignSpec.model_dump_json, "yaml": campaign_yaml}

CACHED = {
    "ETag": {
        "description": "Changes whenever the body does; absent where the folder of a finished run cannot be read.",
        "schema": {"type": "string"},
    },
    "Cache-Control": TAGGED[200]["headers"]["Cache-Control"],
}
UNCHANGED: Responses = {304: {"description": "What If-None-Match names still holds", "headers": CACHED}}


def _content(**examples: str) -> dict[str, Any]:
    """Media types of an answer that is text, with an example of each."""
    return {MEDIA_TYPES[name]: {"schema": {"type": "string"}, "example": text} for name, text in examples.items()}


TABLE: Responses = {
    200: {
        "headers": CACHED,
        "content": _content(
            md="# Comparison of methods\n\n…\n\n## low, search\n\n| method | seeds | ECR | …",
            csv="family,method,phase,runs,episodes,failures,…\nlow,random,search,2,80,3,…",
        ),
    }
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
FIGURE: Responses = {200: {"headers": CACHED, "content": {media_type: {} for media_type in IMAGE_TYPES.values()}}}

router = APIRouter(prefix="/v1/campaigns/{campaign_id}", tags=["reports"], responses=STORAGE | INVALID | UNKNOWN)


@router.get("/table", response_model=Table, responses=TABLE | UNCHANGED | UNACCEPTABLE)
def get_table(
    campaign_id: str,
    request: Request,
    service: Service,
    caller: CurrentCaller,
    format_: Annotated[
        TableFormat | None, Query(alias="format", description="Instead of the Accept header, for a browser.")
    ] = None,
) -> Response:
    """The methods compared over seeds by the runs that have finished, with the others named; empty before the first."""
    campaign = service.store.campaign(campaign_id, caller.sees)
    name = format_ or accepted_format(request, _types(TABLES))
    command, spec_command = commands(request, campaign_id)

    def table(report: CampaignReport) -> str:
        return TABLES[name](replace(report.comparison, command=command, spec_command=spec_command))

    return _shown(request, service, campaign, (name,), table, MEDIA_TYPES[name], vary="Accept")


@router.get("/clusters", response_model=Clusters, responses=FIGURES | UNCHANGED)
def get_clusters(campaign_id: str, request: Request, service: Service, caller: CurrentCaller) -> Response:
    """Which different failures the finished runs have found, named in words, and one of each to look at first."""
    campaign = service.store.campaign(campaign_id, caller.sees)

    def clusters(report: CampaignReport) -> str:
        comparison = report.comparison
        return Clusters(complete=not comparison.missing, families=comparison.overviews).model_dump_json()

    return _shown(request, service, campaign, ("clusters",), clusters, MEDIA_TYPES["json"])


@router.get("/figures", response_model=Figures, responses=FIGURES | UNCHANGED)
def list_figures(campaign_id: str, request: Request, service: Service, caller: CurrentCaller) -> Response:
    """The figures that the finished runs allow: how the methods search, what they reach, λ and α."""
    campaign = service.store.campaign(campaign_id, caller.sees)

    def figures(report: CampaignReport) -> str:
        items = [Figure(name=name, files=_files(campaign_id, name)) for name in report.figures]
        return Figures(complete=not report.comparison.missing, items=items).model_dump_json()

    return _shown(request, service, campaign, ("figures",), figures, MEDIA_TYPES["json"])


@router.get("/figures/{name}.{format}", response_class=Response, responses=FIGURE | UNCHANGED)
def get_figure(
    campaign_id: str,
    name: str,
    format: Format,
    request: Request,
    service: Service,
    caller: CurrentCaller,
) -> Response:
    """One figure; drawn when it is first asked for, and again once more runs have finished."""
    campaign = service.store.campaign(campaign_id, caller.sees)
    return _shown(
        request, service, campaign, (name, format), lambda report: report.figure(name, format), IMAGE_TYPES[format]
    )


@router.get("/spec", response_model=CampaignSpec, responses=SPEC | UNACCEPTABLE)
def get_spec(
    campaign_id: str,
    request: Request,
    service: Service,
    caller: CurrentCaller,
    format_: Annotated[
        SpecFormat | None, Query(alias="format", description="Instead of the Accept header, for a browser.")
    ] = None,
) -> Response:
    """The campaign alone: JSON to post again, or YAML for `risk-sac run --spec` and `risk-sac evaluate --spec`."""
    spec = service.store.campaign(campaign_id, caller.sees).spec
    name = format_ or accepted_format(request, _types(SPECS))
    return Response(SPECS[name](spec), headers={"Vary": "Accept"}, media_type=MEDIA_TYPES[name])


def _shown(
    request: Request,
    service: Context,
    campaign: StoredCampaign,
    parts: tuple[str, ...],
    show: Callable[[CampaignReport], str | bytes],
    media_type: str,
    vary: str = "",
) -> Response:
    """What the report says in one representation, which `parts` name, unless the client has it."""
    tag = entity_tag(service.reports.edition(campaign), *parts)
    if has(request, tag):
        return not_modified(tag, vary)
    report = service.reports.report(campaign)
    return Response(show(report), headers=caching(tag if report.lasting else None, vary), media_type=media_type)


def _types(formats: Iterable[str]) -> dict[str, str]:
    return {name: MEDIA_TYPES[name] for name in formats}


def _files(campaign_id: str, name: str) -> list[FigureFile]:
    path = f"/v1/campaigns/{campaign_id}/figures/{name}"
    return [FigureFile(format=each, media_type=IMAGE_TYPES[each], href=f"{path}.{each}") for each in FORMATS]


def commands(request: Request, campaign_id: str) -> tuple[str, str]:
    """What to type to queue the campaign again, and to have it as a file for the command line."""
    campaigns = f"{request.base_url}v1/campaigns"
    spec, post, as_yaml = map(
        shlex.quote,
        (f"{campaigns}/{campaign_id}/spec", campaigns, f"{campaigns}/{campaign_id}/spec?format=yaml"),
    )
    again = f"curl -s {spec} | curl {post} -H 'content-type: application/json' -d @-"
    return again, f"curl -s {as_yaml} -o spec.yaml"
