"""Uploading road networks to a real server."""

import contextlib
import gzip
import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from service.keys import KeyFile, Scope
from tests.hostile_networks import ADDITIONAL, NET, ROUTES, zipped

NETS = [Path(__file__).parents[2] / "sumo_nets" / name / f"{name}.net.xml" for name in ("dense", "low", "mixed")]
HALF = b"POST /v1/networks HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/xml\r\nContent-Length: 999\r\n\r\n<"


def post(
    client: httpx.Client, content: bytes | str | Iterator[bytes] = NET, kind: str = "xml", **query: str
) -> httpx.Response:
    return client.post("/v1/networks", content=content, params=query, headers={"content-type": f"application/{kind}"})


def test_good_networks_survive_a_restart_and_are_listed_in_pages_until_deleted(serve):
    service = serve()
    uploads = {
        "xml": [net.read_bytes() for net in NETS],
        "gzip": [gzip.compress(NETS[1].read_bytes())],
        "zip": [zipped(NET, ROUTES, ADDITIONAL, names=("a/net.xml", "a/b.rou.xml", "c.add.xml"))],
    }
    taken = []
    for kind, contents in uploads.items():
        for content in contents:
            response = post(service.client, content, kind, label=kind)
            assert response.status_code == 201, response.text
            assert response.headers["location"] == f"/v1/networks/{response.json()['id']}"
            taken.append(response.json())
    assert [(network["edges"], network["junctions"], network["lanes"]) for network in taken] == [
        (8, 5, 24),
        (1, 2, 3),
        (6, 4, 18),
        (1, 2, 3),
        (1, 2, 1),
    ]
    assert [(file["name"], file["kind"]) for file in taken[-1]["files"]] == [
        ("net.xml", "net"),
        ("routes-1.xml", "routes"),
        ("additional-2.xml", "additional"),
    ]
    assert taken[1]["files"] == taken[3]["files"]  # however it was packed
    service.stop()
    service.start()
    assert service.client.get("/v1/networks").json() == {"items": taken[::-1], "next": None}
    path = f"/v1/networks/{taken[0]['id']}"
    assert service.client.get(path).json() == taken[0]
    first = service.client.get("/v1/networks", params={"limit": 3}).json()
    rest = service.client.get("/v1/networks", params={"limit": 3, "cursor": first["next"]}).json()
    assert (first["items"] + rest["items"], rest["next"]) == (taken[::-1], None)
    assert service.client.delete(path).status_code == 204
    for method in ("GET", "DELETE"):
        gone = service.client.request(method, path)
        assert (gone.status_code, gone.json()["reason"]) == (404, "unknown_id")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Networks of other shapes, made by SUMO's own tools."""
    folder = tmp_path_factory.mktemp("made")
    command = Path(sys.executable).parent / "netgenerate"
    for name, options in {
        "actuated": "--grid --grid.number 2 -L 2 --tls.default-type actuated --default-junction-type traffic_light",
        "random": "--rand --rand.iterations 30 --seed 3 --sidewalks.guess --crossings.guess --walkingareas",
        "left-hand": "--grid --grid.number 2 --lefthand --random-type",
    }.items():
        subprocess.run([command, *options.split(), "-o", folder / f"{name}.net.xml"], capture_output=True, check=True)
    return folder


@pytest.mark.parametrize("name", ["actuated", "random", "left-hand"])
def test_networks_that_sumos_tools_make_are_taken(client, made, name):
    response = post(client, (made / f"{name}.net.xml").read_bytes())
    assert response.status_code == 201, response.text
    assert response.json()["edges"] > 1
    assert any("keeps to the left" in said for said in response.json()["warnings"]) == (name == "left-hand")


def test_slow_senders_of_one_key_keep_out_that_key_and_nobody_else(serve_inside):
    service = serve_inside(body_patience_s=600)
    keys = KeyFile(service.data_dir / "keys.json")
    slow, other = (keys.create("maps", name, Scope.RUN)[1] for name in ("slow", "other"))
    senders = [socket.create_connection(("127.0.0.1", service.port)) for _ in range(4)]
    for sender in senders:
        sender.sendall(HALF.replace(b"\r\n\r\n", f"\r\nAuthorization: Bearer {slow}\r\n\r\n".encode()))
    incoming = service.data_dir / "networks" / ".incoming"
    service.wait_until(lambda: incoming.exists() and len(list(incoming.iterdir())) == 2)
    service.client.headers["authorization"] = f"Bearer {slow}"
    more = post(service.client)
    assert (more.status_code, more.json()["reason"], more.headers["retry-after"]) == (429, "quota_exceeded", "5")
    assert service.client.get("/v1/networks").status_code == 200
    service.client.headers["authorization"] = f"Bearer {other}"
    assert post(service.client).status_code == 201
    for sender in senders:
        sender.close()
    service.wait_until(lambda: not list(incoming.iterdir()))
    service.client.headers["authorization"] = f"Bearer {slow}"
    assert post(service.client).status_code == 200  # the project has it


@pytest.mark.parametrize("path", ["/v1/networks", "/v1/campaigns"])
def test_who_sends_too_slowly_is_told_so_and_hung_up_on(serve_inside, path):
    service = serve_inside(body_patience_s=0.5)
    kind = b"xml" if path == "/v1/networks" else b"json"
    with socket.create_connection(("127.0.0.1", service.port), timeout=0.1) as sender:
        sender.sendall(HALF.replace(b"/v1/networks", path.encode()).replace(b"xml", kind))
        answer = b""
        while not answer.endswith(b"}"):
            with contextlib.suppress(TimeoutError, BrokenPipeError):
                sender.sendall(b" ")
            with contextlib.suppress(TimeoutError):
                answer += sender.recv(10_000)
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 408 ")
    assert b"connection: close" in head
    assert json.loads(body)["reason"] == "upload_too_slow"
    assert not list(service.data_dir.glob("networks/.incoming/*"))


def test_a_server_that_is_killed_while_it_receives_leaves_nothing_behind(shared):
    incoming = shared.data_dir / "networks" / ".incoming"
    with socket.create_connection(("127.0.0.1", shared.port)) as sender:
        sender.sendall(HALF)
        shared.wait_until(lambda: list(incoming.glob("*/upload")))
        shared.stop(signal.SIGKILL)
    shared.start()
    assert not incoming.exists()
