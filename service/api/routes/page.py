"""The page for people: static files, built from `service/web`, which ask the API for everything else."""

from pathlib import Path
from typing import Any

from fastapi.responses import RedirectResponse
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

import service

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


def routes() -> list[Route | Mount]:
    """The page at `/page/`, or a word on how to build it."""
    shown = Mount("/page", _Page(directory=BUILT, html=True)) if BUILT.is_dir() else Route("/page/", _missing)
    return [Route("/page", _to_page), shown]
