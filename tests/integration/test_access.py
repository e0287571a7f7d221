"""Access rights on real servers: every route against every missing right."""

import json
import time
import uuid
from contextlib import contextmanager
from functools import reduce
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest
from fastapi.routing import iter_route_contexts

from service.app import create_app
from service.keys import KeyFile, Scope
from service.settings import ServiceSettings
from tests.server import LONG_S

UNKNOWN = "x0000000000000000"
PROBLEM = "application/problem+json"
FRIEND = "http://friend.example"
ROADS = Path(__file__).parents[2] / "sumo_nets" / "low" / "low.net.xml"
SPEC = {"families": ["low"], "methods": ["random"], "budget": {"episodes": 4}}
REGRESSIONS = "/v1/regressions"
CAMPAIGN, NETWORK = "/v1/campaigns/{campaign_id}", "/v1/networks/{network_id}"
SCENARIOS, SCENARIO = "/v1/scenarios", "/v1/scenarios/{scenario}"
DOCUMENT = {
    "summary": "A van ahead of the ego brakes.",
    "network": "low",
    "parameters": {"gap": {"unit": "m", "range": [20, 50]}},
    "ego": {"start": {"lane": "road_1", "at_m": 200}, "speed": 12},
    "actors": {"van": {"body": "van", "start": {"ahead_of": "ego", "gap_m": "gap"}, "speed": 12}},
}
CHECK = "/v1/campaigns/check"
TRIAGE = f"{CAMPAIGN}/failures/{{failure_id}}/triage"

PUBLIC = {"/", "/page", "/healthz", "/readyz", "/openapi.json", "/docs"}


def scope_of(method, path):
    """Returns the scope that a route requires by rule; None if public."""
    if path in PUBLIC:
        return None
    return Scope.ADMIN if path == "/metrics" else Scope.READ if method == "GET" else Scope.RUN


ROUTES = sorted(
    (route.path, method)
    for route in iter_route_contexts(create_app(ServiceSettings()).routes)
    for method in (route.methods or {"GET"}) - {"HEAD"}
)
some_routes = pytest.mark.parametrize(("path", "method"), ROUTES[::9], ids=lambda part: part.strip("/"))
every_route = pytest.mark.parametrize(("path", "method"), ROUTES, ids=lambda part: part.strip("/"))


@pytest.fixture(scope="module")
def world(serve_shared, scripted, tmp_path_factory):
    """Server open to other machines, with two projects' keys and a campaign."""
    folder = tmp_path_factory.mktemp("world")
    file = KeyFile(folder / "keys.json")
    holders = {
        "admin": ("ops", Scope.ADMIN),
        "own": ("maps", Scope.RUN),
        "reader": ("maps", Scope.READ),
        "other": ("rivals", Scope.RUN),
        "revoked": ("maps", Scope.ADMIN),
    }
    made = {name: file.create(project, name, scope) for name, (project, scope) in holders.items()}
    file.revoke(made["revoked"][0].id)
    settings = {"host": "0.0.0.0", "cors_origins": json.dumps([FRIEND]), "rate_limit": "100000"}
    service = serve_shared("striking_worker", data_dir=folder, **settings)
    tokens = {name: token for name, (_, token) in made.items()}
    service.client.headers["authorization"] = f"Bearer {tokens['own']}"
    campaign = service.post(seeds=[scripted.WAITS], budget={"episodes": 100_000})
    service.wait_until(lambda: service.get(campaign)["progress"]["failures"] > 0)
    failure = service.get(campaign, "/failures")["items"][0]["id"]
    with httpx.Client(base_url=service.client.base_url, timeout=LONG_S) as nobody:
        yield SimpleNamespace(
            service=service,
            file=file,
            tokens=tokens,
            campaign=campaign,
            failure=failure,
            run=service.get(campaign)["runs"][0]["id"],
            network=upload(service),
            scenario=post_scenario(service),
            nobody=nobody,
        )


def upload(service):
    content = ROADS.read_bytes() + f"<!-- {uuid.uuid4()} -->".encode()  # a network of its own
    headers = {"content-type": "application/xml"}
    return service.client.post("/v1/networks", content=content, headers=headers).raise_for_status().json()["id"]


def post_scenario(service):
    document = DOCUMENT | {
        "name": "vans",
        "summary": uuid.uuid4().hex,
    }  # its name is as long as UNKNOWN
    return service.client.post(SCENARIOS, json=document).raise_for_status().json()["name"]


def ask(world, method, path, key=None, known=True, **headers):
    """Returns a route's answer to a key's holder; of streams the beginning."""
    ids = (world.campaign, world.network, world.scenario) if known else (UNKNOWN,) * 3
    parts = {"campaign_id": ids[0], "network_id": ids[1], "scenario": ids[2], "failure_id": world.failure}
    parts |= {"regression_id": f"{ids[0]}-{'0' * 16}", "twin": "idle", "run_id": world.run}
    url = path.format(**parts, name="ecr_low", format="png")
    if key is not None:
        headers["authorization"] = f"Bearer {world.tokens.get(key, key)}"
    content = b""
    if (method, path) in (("POST", "/v1/campaigns"), ("POST", CHECK)):
        content, headers["content-type"] = json.dumps(SPEC).encode(), "application/json"
    elif path == TRIAGE:
        content, headers["content-type"] = b'{"state": "confirmed"}', "application/json"
    elif path == f"{CAMPAIGN}/tags":
        content, headers["content-type"] = b'{"tags": ["nightly"]}', "application/json"
    elif (method, path) == ("POST", REGRESSIONS):
        content = json.dumps({"campaign_id": ids[0], "ego": {}}).encode()
        headers["content-type"] = "application/json"
    elif (method, path) == ("POST", "/v1/networks"):
        content, headers["content-type"] = b"<roads/>", "application/xml"
    elif method == "POST" and path in (SCENARIOS, f"{SCENARIOS}/check"):
        content, headers["content-type"] = b"name: nothing else", "application/yaml"
    with world.nobody.stream(method, url, content=content, headers=headers) as response:
        streams = response.headers.get("content-type", "").startswith("text/event-stream")
        text = next(response.iter_text()) if streams else response.read().decode("latin-1")
    return SimpleNamespace(status=response.status_code, headers=response.headers, text=text)


def assert_refused(answer, status, reason):
    assert answer.status == status, answer.text
    assert answer.headers["content-type"] == PROBLEM
    assert json.loads(answer.text)["reason"] == reason


def assert_alike(world, known, unknown):
    """Whether answers differ by nothing but the id that was asked for."""
    assert known.status == unknown.status
    ids = (world.campaign, world.network, world.scenario)
    assert reduce(lambda text, id_: text.replace(id_, UNKNOWN), ids, known.text) == unknown.text
    changing = ("date", "x-request-id")
    first, second = ({k: v for k, v in each.headers.items() if k not in changing} for each in (known, unknown))
    assert first == second


@pytest.fixture
def unchanged(world):
    """Whatever the test does, it changes nothing of the project."""

    def seen():
        campaigns = json.loads(ask(world, "GET", "/v1/campaigns", "own").text)["items"]
        states = [(each["id"], each["state"]) for each in campaigns]
        kept = [ask(world, "GET", path, "own").text for path in ("/v1/networks", SCENARIOS)]
        return states, kept, world.file.path.read_bytes()

    before = seen()
    yield
    assert seen() == before


def test_what_needs_no_key_is_among_the_routes():
    assert {path for path, _ in ROUTES} > PUBLIC
    assert len(ROUTES) > 50


def assert_let_in(answer):
    assert answer.status < 500, answer.text
    assert answer.status not in (401, 403, 405, 421, 429), answer.text


@every_route
def test_a_route_refuses_whoever_may_not_and_tells_nothing(world, unchanged, path, method):
    wanted = scope_of(method, path)
    strangers = (None, "revoked", world.tokens["own"][:-1], f"rsk_00000000_{'A' * 43}", "nonsense")
    refused = [(key, 401, "unauthorized") for key in strangers if wanted]
    refused += [("reader", 403, "forbidden")] * (wanted in (Scope.RUN, Scope.ADMIN))
    if wanted is Scope.ADMIN:
        refused.append(("other", 403, "forbidden"))
    elif path.startswith((CAMPAIGN, NETWORK, SCENARIO, f"{REGRESSIONS}/")) or path == REGRESSIONS:
        refused.append(("other", 404, "unknown_id"))
    else:
        answer = ask(world, method, path, "other")
        assert_let_in(answer)
        assert world.campaign not in answer.text
        assert world.network not in answer.text
        assert world.scenario not in answer.text
    for key, status, reason in refused:
        answer = ask(world, method, path, key)
        assert_refused(answer, status, reason)
        assert answer.headers.get("www-authenticate") == ("Bearer" if status == 401 else None)
        assert_alike(world, answer, ask(world, method, path, key, known=False))
    for origin in ("http://evil.example", "null", "http://127.0.0.1", f"{FRIEND}.evil.example"):
        answer = ask(world, method, path, "admin", origin=origin)
        assert "access-control-allow-origin" not in answer.headers
        if method == "GET":
            assert_let_in(answer)
        else:
            assert_refused(answer, 403, "foreign_origin")


@some_routes
def test_a_forged_host_gets_no_answer(world, unchanged, path, method):
    for host in ("evil.example", "127.0.0.1.evil.example", "localhost.evil.example:80", "0.0.0.0.evil.example"):
        assert_refused(ask(world, method, path, "own", host=host), 421, "unknown_host")


@every_route
def test_a_route_lets_in_whoever_may(world, path, method):
    wanted = scope_of(method, path)
    holder = {None: None, Scope.READ: "reader", Scope.RUN: "own", Scope.ADMIN: "admin"}[wanted]
    own = world
    if method in ("DELETE", "PUT") or path.endswith("/cancel"):  # not the ones that the other tests look at
        own = SimpleNamespace(**vars(world))
        if path.startswith(CAMPAIGN):
            own.campaign = world.service.post(budget={"episodes": 100_000})
        own.network = upload(world.service) if path == NETWORK else None
        own.scenario = post_scenario(world.service) if path == SCENARIO else None
    for origin in ({"origin": FRIEND}, {"origin": f"http://127.0.0.1:{world.service.port}"}, {}):
        answer = ask(own, method, path, holder, **origin)
        assert_let_in(answer)
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["cache-control"] in ("no-store", "no-cache")
        assert "server" not in answer.headers
    if own.campaign != world.campaign:
        ask(own, "POST", f"{CAMPAIGN}/cancel", "own")


def test_an_admin_sees_all_projects_and_others_their_own(world):
    def labels(key):
        return {item["label"] for item in json.loads(ask(world, "GET", "/v1/campaigns", key).text)["items"]}

    headers = {"authorization": f"Bearer {world.tokens['other']}"}
    world.service.client.post("/v1/campaigns", json=SPEC | {"label": "rival"}, headers=headers)
    assert "rival" in labels("admin")
    assert "rival" in labels("other")
    assert "rival" not in labels("own")
    assert ask(world, "GET", CAMPAIGN, "admin").status == 200


def test_an_admin_stops_and_removes_what_any_project_has_begun(world):
    own = SimpleNamespace(**vars(world) | {"campaign": world.service.post(budget={"episodes": 100_000})})
    own.network = upload(world.service)
    for key, status in (("other", 404), ("reader", 403), ("admin", 202)):
        assert ask(own, "POST", f"{CAMPAIGN}/cancel", key).status == status
    world.service.wait(own.campaign)
    for path in (CAMPAIGN, NETWORK):
        for key, status in (("other", 404), ("reader", 403), ("admin", 204), ("own", 404)):
            assert ask(own, "DELETE", path, key).status == status


def test_a_stream_ends_with_its_key(world):
    key, token = world.file.create("maps", "", Scope.READ)
    headers = {"authorization": f"Bearer {token}"}
    busy = world.service.post(budget={"episodes": 100_000})
    with world.nobody.stream("GET", f"/v1/campaigns/{busy}/events", headers=headers) as response:
        received = response.iter_text()
        next(received)
        world.file.revoke(key.id)
        began = time.monotonic()
        for _ in received:  # what was on its way already
            pass
    assert time.monotonic() - began < 60  # at the next event or heartbeat, and long before the campaign's end
    assert ask(world, "GET", f"{CAMPAIGN}/events", token).status == 401
    world.service.client.post(f"/v1/campaigns/{busy}/cancel")


@contextmanager
def keys(world, content):
    """The keys file, with something else in it for a while."""
    whole = world.file.path.read_bytes()
    world.file.path.unlink()
    if content is not None:
        world.file.path.write_bytes(content)
    try:
        yield
    finally:
        world.file.path.write_bytes(whole)


def test_damaged_keys_let_nobody_in(world):
    with keys(world, b'{"keys": [], "sha256": ""}'):
        for key in (None, "own", "admin"):
            assert_refused(ask(world, "GET", CAMPAIGN, key), 503, "keys_unavailable")
            assert_refused(ask(world, "POST", "/v1/campaigns", key), 503, "keys_unavailable")
        assert ask(world, "GET", "/healthz").status == 200
    assert ask(world, "GET", CAMPAIGN, "own").status == 200


@some_routes
def test_with_its_keys_missing_a_service_lets_nobody_in_and_says_what_to_do(world, path, method):
    with keys(world, None):
        for key in (None, "own", "admin"):
            answer = ask(world, method, path, key)
            if scope_of(method, path) is None:
                assert_let_in(answer)
            else:
                assert_refused(answer, 503, "keys_unavailable")
                assert "risk-sac keys create" in answer.text
    assert ask(world, "GET", CAMPAIGN, "own").status == 200


def preflight(world, origin, method="POST", headers="authorization,content-type,idempotency-key"):
    asked = {"access-control-request-method": method, "access-control-request-headers": headers}
    return ask(world, "OPTIONS", "/v1/campaigns", origin=origin, **asked)


def test_a_page_of_a_named_origin_may_call(world):
    answer = preflight(world, FRIEND)
    assert answer.status == 200
    assert answer.headers["access-control-allow-origin"] == FRIEND
    assert "POST" in answer.headers["access-control-allow-methods"]
    assert "Authorization" in answer.headers["access-control-allow-headers"]
    for key, status in (("own", 200), (None, 401)):
        answer = ask(world, "GET", CAMPAIGN, key, origin=FRIEND)
        assert (answer.status, answer.headers["access-control-allow-origin"]) == (status, FRIEND)
        assert "ETag" in answer.headers["access-control-expose-headers"]


def test_a_page_of_another_origin_may_not_call(world):
    answer = preflight(world, "http://evil.example")
    assert answer.status == 400
    assert "access-control-allow-origin" not in answer.headers
    assert preflight(world, FRIEND, method="PATCH").status == 400
    assert preflight(world, FRIEND, headers="x-secret").status == 400
