"""HTTP to browsers, curl, and clients that disconnect."""

import gzip
import json
import re
import socket
from html.parser import HTMLParser

import httpx
import pytest

from tests.hostile_networks import NET
from tests.server import LONG_S

SPEC = {"families": ["low"], "methods": ["random"], "budget": {"episodes": 1}}
POST = b"POST %s HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/%s\r\nContent-Length: 99\r\n\r\n%s"


@pytest.fixture(scope="module")
def campaign(shared):
    campaign_id = shared.client.post("/v1/campaigns", json=SPEC).raise_for_status().json()["id"]
    assert shared.wait(campaign_id)["state"] == "succeeded"
    return campaign_id


def test_head_answers_as_get_does_without_the_body(client, campaign):
    paths = [path for path, methods in client.get("/openapi.json").json()["paths"].items() if "get" in methods]
    assert len(paths) > 15
    for path in [*paths, "/docs", "/docs/swagger-ui.css", "/nothing"]:
        ids = {
            "campaign_id": campaign,
            "failure_id": "x",
            "network_id": "x",
            "regression_id": "x",
            "run_id": "x",
            "scenario": "low",
        }
        url = path.format(**ids, name="ecr_low", format="png", twin="idle")
        with client.stream("GET", url) as got:
            pass
        head = client.head(url)
        assert head.content == b""
        assert head.status_code == got.status_code, url
        assert head.headers.keys() ^ got.headers.keys() <= {"transfer-encoding"}, url
        for name in head.headers.keys() - {"transfer-encoding", "date", "x-request-id", "content-length"}:
            assert head.headers[name] == got.headers[name], (url, name)


def test_a_connection_goes_on_after_a_head_of_a_stream(client, campaign):
    limits = httpx.Limits(max_connections=1)
    with httpx.Client(base_url=client.base_url, limits=limits, timeout=LONG_S) as one:
        for _ in range(3):
            assert one.head(f"/v1/campaigns/{campaign}/events").status_code == 200
            assert one.get("/healthz").json() == {"status": "ok"}


@pytest.mark.parametrize("path", ["/v1/campaigns", "/v1/networks"])
def test_what_curl_sends_by_itself_is_refused_with_what_to_send(client, path):
    form = client.post(path, files={"file": ("x.json", b"{}")})
    data = client.post(path, data={"a": "b"})
    for response in (form, data):
        assert (response.status_code, response.json()["reason"]) == (415, "unsupported_media_type")
        assert "--data-binary @FILE" in response.json()["detail"]
    remedy = re.search(r"content-type: ([\w/]+)'", form.json()["detail"])[1]
    assert client.post(path, content=b"", headers={"content-type": remedy}).status_code in (400, 422)


@pytest.mark.parametrize(
    ("path", "kind", "body", "status"),
    [("/v1/campaigns", "json", json.dumps(SPEC), 202), ("/v1/networks", "xml", NET, 201)],
)
def test_what_is_packed_for_the_way_is_refused(client, path, kind, body, status):
    def post(content, encoding):
        headers = {"content-type": f"application/{kind}", "content-encoding": encoding}
        return client.post(path, content=content, headers=headers)

    packed = post(gzip.compress(body.encode()), "gzip")
    assert packed.status_code == 415
    assert "content-encoding is 'gzip'; wanted none" in packed.json()["detail"]
    assert post(body.encode(), "identity").status_code == status


class Links(HTMLParser):
    """What a page makes a browser load."""

    def __init__(self, page):
        super().__init__()
        self.found = []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.found += [value for name, value in attributes if name in ("src", "href")]


def test_the_docs_need_no_network(client):
    page = client.get("/docs").raise_for_status()
    links = Links(page.text).found
    assert len(links) == 3
    for link in links:
        asset = client.get(page.url.join(link))
        assert asset.url.host == page.url.host, link
        assert asset.status_code == 200
        assert asset.headers["content-type"].partition(";")[0] in ("text/javascript", "text/css", "image/png")
        assert asset.headers["x-content-type-options"] == "nosniff", "which makes a browser insist on the type"
    assert "http" not in page.text.partition("<body>")[2], "nothing from elsewhere"
    assert page.headers["content-security-policy"].startswith("default-src 'self';"), "nor from within the scripts"
    description = re.search(r'"?url"?: ["\'](.*?)["\']', page.text)[1]
    assert client.get(page.url.join(description)).json()["openapi"]


def test_links_lead_below_the_path_that_a_proxy_has_the_service_at(serve_inside):
    service = serve_inside(root_path="/sim")
    location = service.client.post("/v1/campaigns", json=SPEC).headers["location"]
    assert re.fullmatch("/sim/v1/campaigns/c[0-9a-f]+", location)
    path = location.removeprefix("/sim")

    def get(path):
        return service.client.get(path).raise_for_status()

    assert get("/openapi.json").json()["servers"] == [{"url": "/sim"}]
    assert get("/").json()["docs"] == "/sim/docs"
    assert f"{service.client.base_url}/sim/v1/campaigns" in get(f"{path}/table?format=md").text
    assert get(path).json()["id"] in location
    assert get("/page/").status_code == get("/readyz").status_code == 200
    assert service.client.post(f"{path}/cancel").headers["location"] == location
    assert service.client.get("/v1/nothing").json()["instance"] == "/sim/v1/nothing"
    assert service.client.patch(path).headers["allow"] == "DELETE, GET, HEAD"


def test_who_leaves_in_the_middle_of_a_body_is_counted_as_such(serve):
    service = serve()
    for path, kind in ((b"/v1/campaigns", b"json"), (b"/v1/networks", b"xml")):
        for _ in range(3):
            with socket.create_connection(("127.0.0.1", service.port)) as connection:
                connection.sendall(POST % (path, kind, b"{"))
        labels = f'method="POST",route="{path.decode()}",status="499"'
        counted = f"risk_sac_request_seconds_count{{{labels}}} 3.0"
        service.wait_until(lambda counted=counted: counted in service.client.get("/metrics").text)
    assert 'status="500"' not in service.client.get("/metrics").text
    service.stop()
    assert "Traceback" not in service.log.read_text()


def raw(client, path, **headers):
    """The answer as it travelled, with its body still packed."""
    with client.stream("GET", path, headers={"accept-encoding": ""} | headers) as response:
        return response, b"".join(response.iter_raw())


@pytest.mark.parametrize("path", ["/openapi.json", "/v1/families", "CAMPAIGN", "CAMPAIGN/table"])
def test_large_text_is_packed_for_those_who_can_unpack_it(client, campaign, path):
    path = path.replace("CAMPAIGN", f"/v1/campaigns/{campaign}")
    plain, body = raw(client, path)
    assert plain.status_code == 200
    assert len(body) >= 2000
    for accepted in ("gzip", "br, gzip;q=0.5"):
        packed, content = raw(client, path, **{"accept-encoding": accepted})
        assert packed.headers["content-encoding"] == "gzip", accepted
        assert gzip.decompress(content) == body
        assert int(packed.headers["content-length"]) == len(content) < len(body)
        assert packed.headers.get("etag") == plain.headers.get("etag")
    for response in (plain, packed):
        assert "Accept-Encoding" in response.headers["vary"]
    for refused in ("", "identity", "br"):
        unpacked, content = raw(client, path, **{"accept-encoding": refused})
        assert "content-encoding" not in unpacked.headers, refused
        assert content == body
    if "etag" in packed.headers:
        same, content = raw(client, path, **{"accept-encoding": "gzip", "if-none-match": packed.headers["etag"]})
        assert (same.status_code, content) == (304, b"")
        assert "content-encoding" not in same.headers


def test_a_stream_of_events_is_not_packed(client, campaign):
    response, content = raw(client, f"/v1/campaigns/{campaign}/events", **{"accept-encoding": "gzip"})
    assert "content-encoding" not in response.headers
    assert content.startswith(b"retry: ")
