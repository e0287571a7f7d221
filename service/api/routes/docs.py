"""The entrance: where what is, and a page for people that describes the API and loads nothing from elsewhere."""

from collections.abc import Awaitable, Callable
from importlib.resources import files
from pathlib import Path

from fastapi import APIRouter, Request, Response
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import FileResponse, HTMLResponse, RedirectResponse

from risk_sac import __version__
from service.api.answers.representations import accepted
from service.schemas.operations import Entrance

ASSETS = Path(str(files("fastapi_offline"))) / "static"
SCRIPT, STYLE, ICON = "swagger-ui-bundle.js", "swagger-ui.css", "favicon.png"
# What the page may load and call; it sets itself up by a script within it.
POLICY = "default-src 'self'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data:"

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
    page.headers["Content-Security-Policy"] = POLICY
    return page


def _asset(name: str) -> Callable[[], Awaitable[FileResponse]]:
    async def get_asset() -> FileResponse:
        return FileResponse(ASSETS / name)

    return get_asset


for name in (SCRIPT, STYLE, ICON):
    router.add_api_route(f"/docs/{name}", _asset(name), response_class=FileResponse, include_in_schema=False)
