import pytest

from service.api.gate import allowed_hosts, check_host, check_origin
from service.api.problems import ProblemError
from service.settings import ServiceSettings


def refuses(check: object, *arguments: object) -> int:
    """Status of the refusal; 0 for none."""
    try:
        check(*arguments)
    except ProblemError as error:
        return error.status
    return 0


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("localhost", 0),
        ("127.0.0.1:8000", 0),
        ("[::1]:8000", 0),
        ("search.example:443", 0),
        ("192.168.1.7:8000", 0),  # where the connection came in
        ("192.168.1.8:8000", 421),
        ("localhost.evil.example", 421),
        ("localhost@evil.example", 421),
        ("[::1].evil.example", 421),
        ("[::2]", 421),
        ("localhost:8000:evil", 421),
        ("", 421),
    ],
)
@pytest.mark.parametrize("server", [("192.168.1.7", 8000), ("::ffff:192.168.1.7", 8000)])
def test_only_hosts_of_this_service_are_answered(host, status, server):
    allowed = allowed_hosts([*ServiceSettings().allowed_hosts, "0.0.0.0", "Search.example"])
    assert refuses(check_host, {"server": server}, {b"host": host.encode()}, allowed) == status


def test_a_star_answers_all_hosts_and_no_host_is_none():
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
        (b"https://friend.example.evil.example", 403),
        (b"null", 403),
        (b"\xff", 403),
    ],
)
def test_only_own_and_named_pages_change_anything(origin, status):
    headers = {b"host": b"localhost:8000"} | ({} if origin is None else {b"origin": origin})
    origins = frozenset({"https://friend.example"})
    for method in ("POST", "DELETE", "PUT", "PATCH", "BREW"):
        assert refuses(check_origin, method, headers, origins) == status
    for method in ("GET", "HEAD", "OPTIONS"):
        assert refuses(check_origin, method, headers, origins) == 0
