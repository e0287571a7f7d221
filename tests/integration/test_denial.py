"""Slow connections, bodies and readers do not lock out other clients."""

import contextlib
import json
import os
import resource
import socket
import sys
import time
from pathlib import Path

import httpx
import psutil
import pytest

from service.api import connections
from service.api.routes import server
from service.keys import KeyFile, Scope
from service.settings import ServiceSettings
from tests.contract.serving import serving
from tests.server import LONG_S, ROOT

FILES = 160  # that a server may have open


@pytest.fixture
def few_files():
    """Whatever is started meanwhile may have few files open."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (FILES, limits[1]))
    yield lambda: resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.fixture
def connect():
    """Connections that are closed at the end."""
    with contextlib.ExitStack() as opened:

        def connect(service, *sent):
            connection = opened.enter_context(socket.create_connection(("127.0.0.1", service.port), timeout=LONG_S))
            for data in sent:
                connection.sendall(data)
            return connection

        yield connect


def ended(connection):
    """Whether the server closes a connection that receives a byte occasionally."""
    connection.settimeout(0.1)
    while True:
        try:
            connection.sendall(b"x")
            if not connection.recv(1000):
                return True
        except TimeoutError:
            pass
        except ConnectionError:
            return True


def test_half_open_connections_keep_nobody_out(serve, few_files, connect):
    service = serve()
    few_files()
    campaign = service.post(budget={"episodes": 100_000})
    for number in range(FILES + 40):
        connect(service, b"GET /healthz HTTP/1.1\r\nHost: loc" if number % 2 else b"")
    for _ in range(5):
        with httpx.Client(base_url=service.client.base_url, timeout=LONG_S) as newcomer:
            assert newcomer.get("/healthz").status_code == 200
    done = service.get(campaign)["progress"]["episodes_done"]
    service.wait_for(campaign, lambda seen: seen["progress"]["episodes_done"] > done + 3)
    assert service.get(campaign)["state"] == "running", "not paused for want of a descriptor"
    service.wait_for(service.post(budget={"episodes": 1}), lambda seen: seen["state"] == "succeeded")
    service.stop()
    log = service.log.read_text()
    assert "Traceback" not in log
    assert log.count("connections are as many as may be") == 1


def test_a_head_has_to_come_in_time_on_a_new_connection_and_on_an_old_one(serve_inside, connect):
    service = serve_inside(head_timeout_s=0.5)
    assert ended(connect(service, b"GET /healthz HTTP/1.1\r\nX: "))
    used = connect(service, b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert used.recv(1000).startswith(b"HTTP/1.1 200")
    used.sendall(b"GET /healthz HTTP/1.1\r\nX: ")
    assert ended(used)


def test_an_answer_that_goes_on_is_no_late_head(serve):
    service = serve(head_timeout_s=0.1)
    campaign = service.post(budget={"episodes": 60})
    with service.client.stream("GET", f"/v1/campaigns/{campaign}/events") as response:
        told = response.read().decode()
    assert told.count("event: episode") == 60


def answered(connection):
    """All that the server sends until it closes the connection."""
    return b"".join(iter(lambda: connection.recv(1 << 16), b""))


def test_with_all_connections_at_work_one_more_is_refused(serve_inside):
    service = serve_inside(max_connections=3)
    campaign = service.post(budget={"episodes": 100_000})
    with contextlib.ExitStack() as streams:
        for _ in range(3):
            client = streams.enter_context(httpx.Client(base_url=service.client.base_url, timeout=LONG_S))
            streams.enter_context(client.stream("GET", f"/v1/campaigns/{campaign}/events"))
        with socket.create_connection(("127.0.0.1", service.port), timeout=LONG_S) as connection:
            head, _, body = answered(connection).partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 503 Service Unavailable\r\n")
        assert b"retry-after: 1" in head
        assert json.loads(body)["reason"] == "connections_busy"
    service.wait_until(lambda: service.client.get("/healthz").status_code == 200)


GET = b"GET %s HTTP/1.1\r\nHost: localhost\r\n"
CHUNKED = b"POST /v1/campaigns HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n"
JSON = b"Content-Type: application/json\r\n\r\n"


@pytest.mark.parametrize(
    ("begun", "endless"),
    [
        (GET % b"/healthz", b"x: a\r\n"),
        (GET % b"/healthz" + b"x: ", b"a"),
        (GET % b"/healthz" + b"\r\n" + GET % b"/healthz", b"x: a\r\n"),
        (b"GET /", b"a"),
        (CHUNKED + JSON + b"1", b";a"),
        (CHUNKED + JSON + b"0\r\n", b"x: a\r\n"),
    ],
    ids=["lines", "line", "second head", "address", "chunk", "trailers"],
)
def test_a_head_without_end_is_refused_once_it_is_larger_than_64_kb(shared, connect, begun, endless):
    most = connections.MOST_HEAD_BYTES + connections.PIECE_BYTES
    connection = connect(shared, begun + endless * (most // len(endless)))
    head, _, body = answered(connection)[-1000:].rpartition(b"\r\n\r\n")
    assert b"HTTP/1.1 431 Request Header Fields Too Large\r\n" in head
    assert (json.loads(body)["status"], json.loads(body)["reason"]) == (431, "too_large")


def test_a_head_of_60_kb_is_read(shared):
    assert shared.client.get("/healthz", headers={"x": "a" * 60_000}).status_code == 200


@pytest.mark.parametrize("second", [b"Host: evil.example\r\n\r\n", b"Host: localhost\r\n\r\n"])
@pytest.mark.parametrize("version", [b"1.0", b"1.1"])
def test_two_hosts_are_refused(shared, connect, second, version):
    connection = connect(shared, (GET % b"/v1/methods").replace(b"1.1", version) + second)
    head, _, body = answered(connection).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400 Bad Request\r\n")
    assert json.loads(body)["reason"] == "malformed_http"


def test_queued_requests_are_answered_in_their_order(shared, connect):
    sent = [GET % b"/nothing/%d" % number + b"\r\n" for number in range(300)]
    sent[-1] = sent[-1].replace(b"\r\n\r\n", b"\r\nConnection: close\r\n\r\n")
    answers = answered(connect(shared, b"".join(sent))).split(b"HTTP/1.1 404")[1:]
    assert [int(answer.partition(b"nothing is at /nothing/")[2].split(b";")[0]) for answer in answers] == [*range(300)]


def test_a_key_leaves_connections_for_others(serve_inside, tmp_path):
    file = KeyFile(tmp_path / "data" / "keys.json")
    first, second = (file.create("maps", name, Scope.RUN)[1] for name in ("first", "second"))
    service = serve_inside(max_connections=9)
    service.client.headers["authorization"] = f"Bearer {first}"
    events = f"/v1/campaigns/{service.post(budget={'episodes': 100_000})}/events"
    with contextlib.ExitStack() as streams:

        def follow(key):
            headers = {"authorization": f"Bearer {key}"}
            client = streams.enter_context(httpx.Client(base_url=service.client.base_url, headers=headers, timeout=60))
            return streams.enter_context(client.stream("GET", events))

        assert [follow(first).status_code for _ in range(6)] == [200] * 4 + [429] * 2
        refused = follow(first)
        assert (refused.headers["retry-after"], json.loads(refused.read())["reason"]) == ("1", "connections_busy")
        assert [follow(second).status_code for _ in range(2)] == [200] * 2
        assert httpx.get(f"{service.client.base_url}/healthz").status_code == 200
    service.wait_until(lambda: service.client.get("/v1/campaigns").status_code == 200)


def test_who_reads_nothing_of_an_answer_is_not_waited_for_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(connections, "UNREAD_S", 0.2)
    most = 8 * (server.ASSETS / server.SCRIPT).stat().st_size
    with serving(ServiceSettings(data_dir=tmp_path / "data")) as url, socket.socket() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.settimeout(LONG_S)
        client.connect(("127.0.0.1", httpx.URL(url).port))
        client.sendall(b"GET /docs/%s HTTP/1.1\r\nHost: localhost\r\n\r\n" % server.SCRIPT.encode() * 8)
        assert client.recv(1) == b"H"
        while established(client):
            time.sleep(0.05)
        assert sum(iter(lambda: len(client.recv(1 << 20)), 0)) < most


def test_who_reads_nothing_of_an_answer_makes_room_for_others(serve_inside):
    service = serve_inside(max_connections=4)
    with contextlib.ExitStack() as stack:
        for _ in range(8):
            client = stack.enter_context(socket.socket())
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            client.connect(("127.0.0.1", service.port))
            client.sendall(b"GET /docs/%s HTTP/1.1\r\nHost: localhost\r\n\r\n" % server.SCRIPT.encode() * 8)
        with httpx.Client(base_url=service.client.base_url, timeout=LONG_S) as newcomer:
            service.wait_until(lambda: newcomer.get("/healthz").status_code == 200, timeout_s=connections.UNREAD_S / 2)


def established(client):
    """Whether the server, in this process, still has its connection end."""
    ends = psutil.Process().net_connections("tcp")
    return any(end.raddr == client.getsockname() and end.status == psutil.CONN_ESTABLISHED for end in ends)


def test_a_run_that_needs_too_much_memory_takes_one_attempt(serve):
    service = serve("risk_sac.execution.worker", worker_memory_bytes=1 << 28)  # not even enough for the imports
    (run,) = service.wait(service.post(budget={"episodes": 1}))["runs"]
    assert (run["state"], run["attempts"]) == ("failed", 1)
    assert run["reason"].startswith("the run needs more than the 0.25 GiB of memory that a worker may take")
    assert "RISK_SAC_WORKER_MEMORY_BYTES" in run["reason"]


def test_a_reason_does_not_say_where_on_the_machine_files_lie(serve, scripted, tmp_path):
    data = tmp_path / "data"
    service = serve(data_dir=Path(os.path.relpath(data, ROOT)), attempts=2)
    campaign = service.wait(service.post(seeds=[scripted.RAISES], budget={"episodes": 9}))
    (run,) = campaign["runs"]
    assert run["state"] == "failed"
    assert "FileNotFoundError: [Errno 2] No such file or directory: 'nothing'" in run["reason"]
    told = service.client.get(f"/v1/campaigns/{campaign['id']}").text
    for folder in (tmp_path, ROOT, sys.prefix, data.parent.name):
        assert str(folder) not in told
