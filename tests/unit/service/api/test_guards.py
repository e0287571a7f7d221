import pytest

from service.api.answers.problems import ProblemError
from service.api.context import Caller, check_scope
from service.api.guards.gate import RateLimit, allowed_hosts, check_host, check_origin
from service.app import create_app
from service.keys.file import Scope
from service.settings import ServiceSettings


def refuses(check: object, *arguments: object) -> int:
    """Status of the refusal; 0 for none."""
    try:
        check(*arguments)  # type: ignore[operator]
    except ProblemError as error:
        return error.status
    return 0


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("localhost", 0),
        ("LOCALHOST:8000", 0),
        ("127.0.0.1:8000", 0),
        ("[::1]", 0),
        ("[::1]:8000", 0),
        ("search.example:443", 0),
        ("192.168.1.7:8000", 0),  # where the connection came in
        ("192.168.1.8:8000", 421),
        ("127.0.0.2", 421),
        ("localhost.evil.example", 421),
        ("evil.example", 421),
        ("localhost@evil.example", 421),
        ("[::1].evil.example", 421),
        ("[::2]", 421),
        ("localhost:8000:evil", 421),
        ("", 421),
    ],
)
@pytest.mark.parametrize("server", [("192.168.1.7", 8000), ("::ffff:192.168.1.7", 8000)])
def test_only_hosts_of_this_service_are_answered(host: str, status: int, server: tuple[str, int]) -> None:
    allowed = allowed_hosts([*ServiceSettings().allowed_hosts, "0.0.0.0", "Search.example"])
    assert refuses(check_host, {"server": server}, {b"host": host.encode()}, allowed) == status


def test_a_star_answers_all_hosts_and_no_host_is_none() -> None:
    assert refuses(check_host, {"server": None}, {b"host": b"evil.example"}, allowed_hosts(["*"])) == 0
    assert refuses(check_host, {"server": None}, {}, allowed_hosts(["localhost"])) == 421


@pytest.mark.parametrize(
    ("origin", "status"),
    [
        (None, 0),
        (b"http://localhost:8000", 0),
        (b"https://localhost:8000", 0),  # a proxy in front spoke TLS
        (b"https://friend.example", 0),
        (b"HTTPS://Friend.example", 0),
        (b"http://friend.example", 403),
        (b"http://localhost:9000", 403),
        (b"http://localhost", 403),
        (b"https://friend.example.evil.example", 403),
        (b"null", 403),
        (b"", 403),
        (b"\xff", 403),
    ],
)
def test_only_own_and_named_pages_change_anything(origin: bytes | None, status: int) -> None:
    headers = {b"host": b"localhost:8000"} | ({} if origin is None else {b"origin": origin})
    origins = frozenset({"https://friend.example"})
    for method in ("POST", "DELETE", "PUT", "PATCH", "BREW"):
        assert refuses(check_origin, method, headers, origins) == status
    for method in ("GET", "HEAD", "OPTIONS"):
        assert refuses(check_origin, method, headers, origins) == 0


@pytest.mark.parametrize(("scope", "reach"), [(Scope.READ, 1), (Scope.RUN, 2), (Scope.ADMIN, 3)])
def test_a_key_reaches_as_far_as_its_scope(scope: Scope, reach: int) -> None:
    caller = Caller("maps", scope, "k")
    assert [refuses(check_scope, caller, wanted) for wanted in Scope] == [0] * reach + [403] * (3 - reach)
    assert caller.sees == (None if scope is Scope.ADMIN else "maps")


def test_each_is_counted_alone_and_told_when_to_come_back(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr("service.api.guards.gate.time.monotonic", lambda: now)

    def late(times: int, *who: str) -> list[ProblemError]:
        found = []
        for _ in range(times):
            try:
                rate.count(*who)
            except ProblemError as error:
                found.append(error)
        return found

    rate = RateLimit(5)
    assert late(5, "key", "a") == []
    (refused,) = late(1, "key", "a")
    assert (refused.status, refused.headers) == (429, {"Retry-After": "1"})
    assert late(5, "key", "b") == []
    assert late(5, "address", "a") == [], "an address that is called like a key is not the key"
    now += 1
    assert late(5, "key", "a") == []


def test_what_the_guards_answer_is_documented_for_every_route() -> None:
    document = create_app(ServiceSettings()).openapi()
    for path, operations in document["paths"].items():
        health, public = path in ("/healthz", "/readyz"), path in ("/healthz", "/readyz", "/")
        wanted = {"421", "503"} | (set() if health else {"429"}) | (set() if public else {"401", "403"})
        for method, operation in operations.items():
            body = {"408", "413"} if method in ("post", "put") and not path.endswith("/cancel") else set()
            assert wanted | body <= operation["responses"].keys(), (method, path)
            security = operation.get("security", document["security"])
            assert security == ([] if public else [{"ApiKey": []}, {}]), (method, path)
    assert document["components"]["securitySchemes"]["ApiKey"]["scheme"] == "bearer"
