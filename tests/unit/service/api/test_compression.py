import gzip

import httpx
import pytest
from starlette.applications import Starlette
from starlette.responses import Response
from starlette.routing import Route

from service.api.middleware import LEAST_BYTES, Compression

CONTENT = b"<svg/>" * LEAST_BYTES


async def answer(media_type, accepted="gzip", content=CONTENT, respond=Response, **more):
    """What a client gets of a route that answers so, as it travels."""

    async def route(request):
        return respond(content, media_type=media_type, **more)

    app = Starlette(routes=[Route("/", route)])
    app.add_middleware(Compression, minimum_size=LEAST_BYTES)
    client = httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test")
    async with client, client.stream("GET", "/", headers={"accept-encoding": accepted}) as response:
        return response.headers, b"".join([part async for part in response.aiter_raw()])


TEXTS = ["application/json", "application/problem+json", "image/svg+xml", "text/markdown", "text/csv", "text/plain"]


@pytest.mark.anyio
@pytest.mark.parametrize("media_type", [*TEXTS, "application/yaml"])
async def test_text_is_packed(media_type):
    headers, content = await answer(media_type)
    assert headers["content-encoding"] == "gzip"
    assert headers["vary"] == "Accept-Encoding"
    assert gzip.decompress(content) == CONTENT
    assert len(content) < len(CONTENT) / 20


@pytest.mark.anyio
@pytest.mark.parametrize("media_type", ["image/png", "application/zip", "text/event-stream", "application/gzip"])
async def test_what_is_packed_already_and_streams_of_events_are_not(media_type):
    headers, content = await answer(media_type)
    assert "content-encoding" not in headers
    assert content == CONTENT


@pytest.mark.anyio
async def test_what_is_small_is_not_packed():
    assert "content-encoding" in (await answer("text/csv", content=b"x" * LEAST_BYTES))[0]
    headers, content = await answer("text/csv", content=b"x" * (LEAST_BYTES - 1))
    assert "content-encoding" not in headers
    assert len(content) == LEAST_BYTES - 1


@pytest.mark.anyio
async def test_an_answer_varies_by_what_it_varied_by_and_by_encoding():
    headers, _ = await answer("text/csv", headers={"Vary": "Accept"})
    assert headers["vary"] == "Accept, Accept-Encoding"
    headers, _ = await answer("text/csv", accepted="gzip;q=0", headers={"Vary": "Accept"})
    assert headers["vary"] == "Accept, Accept-Encoding"
    for status, kind in ((304, None), (200, "image/png")):  # what may be kept says so, packed or not
        headers, _ = await answer(kind, content=b"", status_code=status, headers={"Vary": "Accept", "ETag": "W/1"})
        assert headers["vary"] == "Accept, Accept-Encoding"
