"""Routes of the server: entry, description, page, health, metrics, workers and queue."""

import json
from functools import lru_cache
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, Depends, FastAPI, Request, Response
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import HTMLResponse, RedirectResponse
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from risk_sac import __version__
from risk_sac.records import Record
from service.api.context import CurrentCaller, Service, require_admin
from service.api.pages import STOPPED, UNREADY, Responses, link
from service.api.problems import ProblemError, Reason
from service.runs.workers import Workers, workers_body
from service.store.queries import check_readable


class Health(Record):
    """The server is alive."""

    status: Literal["ok"] = "ok"


class Ready(Record):
    """Campaigns can be posted and make progress."""

    status: Literal["ready"] = "ready"


EXAMPLE = 'risk_sac_episodes_total{family="low",method="risk-sac"} 4711.0\n…'
METRICS: Responses = {200: {"content": {"text/plain": {"schema": {"type": "string"}, "example": EXAMPLE}}}}

router = APIRouter()


@router.get("/healthz", tags=["operations"], responses=STOPPED)
async def get_health(service: Service) -> Health:
    """Liveness: restart the service if this fails."""
    if not service.manager.alive:
        detail = "the manager has stopped; the log has the reason"
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.MANAGER_STOPPED, detail)
    return Health()


@router.get("/readyz", tags=["operations"], responses=UNREADY)
def get_readiness(service: Service) -> Ready:
    """Readiness to take and run campaigns; recovers once the cause is gone."""
    problem = service.manager.storage_problem
    if problem is not None:
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.STORAGE_UNAVAILABLE, problem)
    check_readable(service.store.engine)
    return Ready()


# A key that may see all campaigns: the runs at work are among the metrics.
@router.get(
    "/metrics",
    tags=["operations"],
    response_class=Response,
    responses=METRICS,
    dependencies=[Depends(require_admin)],
)
def get_metrics(service: Service) -> Response:
    """Metrics in the text format of Prometheus."""
    return Response(generate_latest(service.metrics), media_type=CONTENT_TYPE_LATEST)


@router.get("/v1/workers", tags=["operations"])
def get_workers(service: Service, caller: CurrentCaller) -> Workers:
    """Runs by worker, and the queue in its order."""
    return workers_body(service.manager, service.store, service.settings, caller.sees)


class Entrance(Record):
    """Paths of this service."""

    name: Literal["RISK-SAC"] = "RISK-SAC"
    version: str
    docs: str
    """A page that describes and calls all routes."""
    openapi: str
    """The same for programs."""
    health: str
    campaigns: str


ASSETS = Path(str(files("fastapi_offline"))) / "static"
SCRIPT, STYLE, ICON = "swagger-ui-bundle.js", "swagger-ui.css", "favicon.png"
# What the page may load and call; it sets itself up by a script within it.
DOCS_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data:"
)
# Swagger UI has a dark theme, but nothing that chooses it: as on the page, the system does until the user has chosen.
DOCS_THEME = """<script>
document.documentElement.classList.toggle("dark-mode", (localStorage.getItem("risk-sac-theme") ??
    (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light")) === "dark");
</script>
"""
BUILT = Path(str(files("service"))) / "web" / "dist"
# Nothing is loaded from elsewhere, and no script or style stands within a document. Pictures that need a key are
# fetched and shown as blobs.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
FOREVER = "public, max-age=31536000, immutable"  # the names of assets tell their content
MISSING = """<!doctype html><title>RISK-SAC</title><p>This installation has no page: it was left out, or not built yet.
<code>python service/web/backend.py</code> builds it. <a href="../docs">The API</a> is there."""


@router.get("/", tags=["operations"], response_model=Entrance)
async def get_entrance(request: Request) -> Entrance | Response:
    """Entry points of the service; redirects a browser to the page."""
    if "text/html" in request.headers.get("accept", ""):
        return RedirectResponse("page/", status_code=303, headers={"Vary": "Accept"})
    paths = {"docs": "/docs", "openapi": "/openapi.json", "health": "/healthz", "campaigns": "/v1/campaigns"}
    return Entrance(version=__version__, **{name: link(request, path) for name, path in paths.items()})


@router.get("/openapi.json", include_in_schema=False)
def get_openapi(request: Request) -> Response:
    """The API's description, for programs; a proxy's path is its server."""
    return Response(_description(request.app, link(request, "")), media_type="application/json")


@lru_cache(maxsize=4)
def _description(app: FastAPI, prefix: str) -> bytes:
    servers = {"servers": [{"url": prefix}]} if prefix else {}
    return json.dumps(app.openapi() | servers, ensure_ascii=False, separators=(",", ":")).encode()


@router.get("/docs", include_in_schema=False)
async def get_docs() -> HTMLResponse:
    """Returns the interactive API description, with relative links for proxies."""
    page = get_swagger_ui_html(
        openapi_url="openapi.json",
        title="RISK-SAC",
        swagger_js_url=f"docs/{SCRIPT}",
        swagger_css_url=f"docs/{STYLE}",
        swagger_favicon_url=f"docs/{ICON}",
        swagger_ui_parameters={"validatorUrl": None},  # it would send the description to another host
    )
    themed = bytes(page.body).decode().replace("</head>", f"{DOCS_THEME}</head>")
    return HTMLResponse(themed, headers={"Content-Security-Policy": DOCS_POLICY})


class _Page(StaticFiles):
    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["Content-Security-Policy"] = POLICY
        if path.startswith("assets/"):
            response.headers["Cache-Control"] = FOREVER
        return response


async def _to_page(request: Request) -> Response:
    return RedirectResponse("page/", status_code=308)


async def _missing(request: Request) -> Response:
    return HTMLResponse(MISSING, status_code=501, headers={"Content-Security-Policy": POLICY})


def page_routes() -> list[Route | Mount]:
    """Returns routes of `/docs` and `/page/`; unbuilt, it says how to build."""
    shown = Mount("/page", _Page(directory=BUILT, html=True)) if BUILT.is_dir() else Route("/page/", _missing)
    return [Mount("/docs", StaticFiles(directory=ASSETS)), Route("/page", _to_page), shown]
