"""The entrance, the page that describes the API, and the page for people; none loads anything from elsewhere."""

from collections.abc import Awaitable, Callable
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from fastapi import APIRouter, Request, Response
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

import service
from risk_sac import __version__
from risk_sac.records import Record
from service.api.answers.representations import accepted


class Entrance(Record):
    """Paths of this service."""

    name: Literal["RISK-SAC"] = "RISK-SAC"
    version: str
    docs: Literal["/docs"] = "/docs"
    """A page that describes and calls all routes."""
    openapi: Literal["/openapi.json"] = "/openapi.json"
    """The same for programs."""
    health: Literal["/healthz"] = "/healthz"
    campaigns: Literal["/v1/campaigns"] = "/v1/campaigns"


ASSETS = Path(str(files("fastapi_offline"))) / "static"
SCRIPT, STYLE, ICON = "swagger-ui-bundle.js", "swagger-ui.css", "favicon.png"
# What the page may load and call; it sets itself up by a script within it.
DOCS_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data:"
)
BUILT = Path(service.__file__).parent / "web" / "dist"
# Nothing is loaded from elsewhere, and no script or style stands within a document. Pictures that need a key are
# fetched and shown as blobs.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
FOREVER = "public, max-age=31536000, immutable"  # the names of assets tell their content
MISSING = """<!doctype html><title>RISK-SAC</title><p>This installation has no page: it was left out, or not built yet.
<code>python service/web/backend.py</code> builds it. <a href="../docs">The API</a> is there."""

router = APIRouter()


@router.get("/", tags=["operations"], response_model=Entrance)
async def get_entrance(request: Request) -> Entrance | Response:
    """Where to go from here; a browser is sent to the page."""
    accept = request.headers.get("accept", "")
    if "text/html" in accept and accepted(accept, ("application/json", "text/html")) == "text/html":
        return RedirectResponse("page/", status_code=303, headers={"Vary": "Accept"})
    return Entrance(version=__version__)


@router.get("/docs", include_in_schema=False)
async def get_docs() -> HTMLResponse:
    """The API's description, to read and to try. Its links are relative, so that a proxy may put it elsewhere."""
    page = get_swagger_ui_html(
        openapi_url="openapi.json",
        title="RISK-SAC",
        swagger_js_url=f"docs/{SCRIPT}",
        swagger_css_url=f"docs/{STYLE}",
        swagger_favicon_url=f"docs/{ICON}",
        swagger_ui_parameters={"validatorUrl": None},  # it would ask somebody else whether the description is right
    )
    page.headers["Content-Security-Policy"] = DOCS_POLICY
    return page


def _asset(name: str) -> Callable[[], Awaitable[FileResponse]]:
    async def get_asset() -> FileResponse:
        return FileResponse(ASSETS / name)

    return get_asset


for name in (SCRIPT, STYLE, ICON):
    router.add_api_route(f"/docs/{name}", _asset(name), response_class=FileResponse, include_in_schema=False)


class _Page(StaticFiles):
    def file_response(self, full_path: Any, *arguments: Any, **more: Any) -> Response:
        response = super().file_response(full_path, *arguments, **more)
        in_assets = Path(full_path).parent.name == "assets"
        response.headers["Cache-Control"] = FOREVER if in_assets else "no-cache"
        response.headers["Content-Security-Policy"] = POLICY
        return response


async def _to_page(request: Request) -> Response:
    return RedirectResponse("page/", status_code=308)


async def _missing(request: Request) -> Response:
    return HTMLResponse(MISSING, status_code=503, headers={"Content-Security-Policy": POLICY})


def page_routes() -> list[Route | Mount]:
    """The page at `/page/`, or a word on how to build it."""
    shown = Mount("/page", _Page(directory=BUILT, html=True)) if BUILT.is_dir() else Route("/page/", _missing)
    return [Route("/page", _to_page), shown]
