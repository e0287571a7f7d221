"""Entry point, API description and web page; none loads anything from other hosts.

They need no key, so each is read and compressed once.
"""

import gzip
import json
import mimetypes
import stat
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from hashlib import blake2b
from importlib.resources import files
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, FastAPI, HTTPException, Request, Response
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import HTMLResponse, RedirectResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

import service
from risk_sac import __version__
from risk_sac.records import Record
from service.api.representations import LEAST_BYTES, accepted, cacheable, link


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


@dataclass(frozen=True, slots=True)
class StaticBody:
    """Static content, plain and compressed."""

    content: bytes
    packed: bytes | None  # None where packing gains little
    media_type: str
    tag: str

    @classmethod
    def of(cls, content: bytes, media_type: str) -> "StaticBody":
        """Compresses long text."""
        text = media_type.startswith("text/") or media_type in ("application/json", "image/svg+xml")
        packed = gzip.compress(content, mtime=0) if text and len(content) >= LEAST_BYTES else None
        return cls(content, packed, media_type, blake2b(content, digest_size=8).hexdigest())

    def response(self, request: Request, others: Mapping[str, str] = {}) -> Response:
        """Returns the content, compressed if accepted; raises NotModified if the client has it."""
        headers = cacheable(request, self.tag, others=others)
        if self.packed and request.headers.get("accept-encoding") == "gzip":  # which `Compression` leaves alone
            return Response(self.packed, headers=headers | {"Content-Encoding": "gzip"}, media_type=self.media_type)
        return Response(self.content, headers=headers, media_type=self.media_type)


@router.get("/", tags=["operations"], response_model=Entrance)
async def get_entrance(request: Request) -> Entrance | Response:
    """Entry points of the service; redirects a browser to the page."""
    accept = request.headers.get("accept", "")
    if "text/html" in accept and accepted(accept, ("application/json", "text/html")) == "text/html":
        return RedirectResponse("page/", status_code=303, headers={"Vary": "Accept"})
    paths = {"docs": "/docs", "openapi": "/openapi.json", "health": "/healthz", "campaigns": "/v1/campaigns"}
    return Entrance(version=__version__, **{name: link(request, path) for name, path in paths.items()})


@router.get("/openapi.json", include_in_schema=False)
def get_openapi(request: Request) -> Response:
    """The API's description, for programs; a proxy's path is its server."""
    return _description(request.app, link(request, "")).response(request)


@lru_cache(maxsize=4)
def _description(app: FastAPI, prefix: str) -> StaticBody:
    servers = {"servers": [{"url": prefix}]} if prefix else {}
    return StaticBody.of(
        json.dumps(app.openapi() | servers, ensure_ascii=False, separators=(",", ":")).encode(), "application/json"
    )


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


def _asset(name: str) -> Callable[[Request], Awaitable[Response]]:
    async def get_asset(request: Request) -> Response:
        return _file(ASSETS / name).response(request)

    return get_asset


for name in (SCRIPT, STYLE, ICON):
    router.add_api_route(f"/docs/{name}", _asset(name), response_class=Response, include_in_schema=False)


@lru_cache(maxsize=64)
def _file(path: Path, written_ns: int = 0) -> StaticBody:
    media_type = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return StaticBody.of(path.read_bytes(), media_type)


class _Page(StaticFiles):
    async def get_response(self, path: str, scope: Scope) -> Response:
        if scope["method"] != "GET":
            raise HTTPException(405, headers={"Allow": "GET"})
        found, status = self.lookup_path("index.html" if path == "." else path)
        if status is None or not stat.S_ISREG(status.st_mode):
            raise HTTPException(404)
        file = Path(found)
        kept = FOREVER if file.parent.name == "assets" else "no-cache"
        headers = {"Cache-Control": kept, "Content-Security-Policy": POLICY}
        return _file(file, status.st_mtime_ns).response(Request(scope), headers)


async def _to_page(request: Request) -> Response:
    return RedirectResponse("page/", status_code=308)


async def _missing(request: Request) -> Response:
    return HTMLResponse(MISSING, status_code=501, headers={"Content-Security-Policy": POLICY})


def page_routes() -> list[Route | Mount]:
    """The page at `/page/`, or a word on how to build it."""
    shown = Mount("/page", _Page(directory=BUILT)) if BUILT.is_dir() else Route("/page/", _missing)
    return [Route("/page", _to_page), shown]
