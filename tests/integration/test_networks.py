"""Uploading road networks to a real server."""

import contextlib
import gzip
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from service.keys.file import KeyFile
from service.keys.key import Scope
from tests.hostile_networks import ADDITIONAL, NET, ROUTES, zipped
from tests.server import Service

NETS = sorted((Path(__file__).parents[2] / "sumo_nets").glob("*/*.net.xml"))
HALF = b"POST /v1/networks HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/xml\r\nContent-Length: 999\r\n\r\n<"
XML = {"content-type": "application/xml"}


def post(
    client: httpx.Client, content: bytes | str | Iterator[bytes] = NET, kind: str = "xml", **query: str
) -> httpx.Response:
    return client.post("/v1/networks", content=content, params=query, headers={"content-type": f"application/{kind}"})


def test_good_networks_are_taken_and_survive_a_restart(serve: Callable[..., Service]) -> None:
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
    assert service.client.get(f"/v1/networks/{taken[0]['id']}").json() == taken[0]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Networks of other shapes, made by SUMO's own tools."""
    folder = tmp_path_factory.mktemp("made")
    command = Path(sys.executable).parent / "netgenerate"
    for name, options in {
        "grid": "--grid --grid.number 4 -L 2 --default-junction-type traffic_light --turn-lanes 1",
        "actuated": "--grid --grid.number 2 -L 2 --tls.default-type actuated --default-junction-type traffic_light",
        "spider": "--spider --spider.omit-center --output.street-names --output.original-names",
        "random": "--rand --rand.iterations 30 --seed 3 --sidewalks.guess --crossings.guess --walkingareas",
        "left-hand": "--grid --grid.number 2 --lefthand --random-type",
    }.items():
        subprocess.run([command, *options.split(), "-o", folder / f"{name}.net.xml"], capture_output=True, check=True)
    return folder


@pytest.mark.parametrize("name", ["grid", "actuated", "spider", "random", "left-hand"])
def test_networks_that_sumos_tools_make_are_taken(client: httpx.Client, made: Path, name: str) -> None:
    response = post(client, (made / f"{name}.net.xml").read_bytes())
    assert response.status_code == 201, response.text
    assert response.json()["edges"] > 1
    assert any("keeps to the left" in said for said in response.json()["warnings"]) == (name == "left-hand")


def test_networks_are_listed_in_pages_and_deleted(serve: Callable[..., Service]) -> None:
    client = serve().client
    ids = [post(client, label=str(i)).json()["id"] for i in range(3)]
    first = client.get("/v1/networks", params={"limit": 2}).json()
    rest = client.get("/v1/networks", params={"limit": 2, "cursor": first["next"]}).json()
    assert [item["id"] for item in first["items"] + rest["items"]] == ids[::-1]
    assert rest["next"] is None
    assert client.delete(f"/v1/networks/{ids[0]}").status_code == 204
    for method in ("GET", "DELETE"):
        gone = client.request(method, f"/v1/networks/{ids[0]}")
        assert (gone.status_code, gone.json()["reason"]) == (404, "unknown_id")


@pytest.mark.parametrize("network_id", ["none", "..%2f..%2fetc%2fpasswd", "n0000000000000000", "%00", "n" * 5000])
def test_an_id_that_was_not_given_out_is_unknown(client: httpx.Client, network_id: str) -> None:
    assert client.get(f"/v1/networks/{network_id}").status_code == 404


def test_an_upload_that_is_too_large_is_refused_with_or_without_its_length(serve: Callable[..., Service]) -> None:
    service = serve(max_upload_bytes=100_000)
    for content in (b"<net>" + b" " * 1_000_000, (b" " * 10_000 for _ in range(100))):
        response = post(service.client, content)
        assert (response.status_code, response.json()["reason"]) == (413, "too_large")
    assert not list(service.data_dir.glob("networks/.incoming/*"))
    assert post(service.client).status_code == 201


def test_an_upload_that_is_packed_for_the_way_is_refused(client: httpx.Client) -> None:
    headers = XML | {"content-encoding": "gzip"}
    response = client.post("/v1/networks", content=gzip.compress(NET.encode()), headers=headers)
    assert response.status_code == 415
    assert "content-encoding is 'gzip'; wanted none" in response.json()["detail"]


def test_slow_senders_of_one_key_keep_out_that_key_and_nobody_else(serve: Callable[..., Service]) -> None:
    service = serve(body_patience_s=600)
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
    assert post(service.client).status_code == 201


@pytest.mark.parametrize("path", ["/v1/networks", "/v1/campaigns"])
def test_who_sends_too_slowly_is_told_so_and_hung_up_on(serve: Callable[..., Service], path: str) -> None:
    service = serve(body_patience_s=0.5)
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


def test_a_server_that_is_killed_while_it_receives_leaves_nothing_behind(shared: Service) -> None:
    incoming = shared.data_dir / "networks" / ".incoming"
    with socket.create_connection(("127.0.0.1", shared.port)) as sender:
        sender.sendall(HALF)
        shared.wait_until(lambda: list(incoming.glob("*/upload")))
        shared.stop(signal.SIGKILL)
    shared.start()
    assert not incoming.exists()


def test_no_project_sees_another_ones_networks(serve: Callable[..., Service], tmp_path: Path) -> None:
    environment = os.environ | {"RISK_SAC_DATA_DIR": str(tmp_path / "data")}

    def key(project: str, scope: str) -> dict[str, str]:
        command = [sys.executable, "-m", "service.keys", "create", "--project", project, "--scope", scope]
        token = subprocess.run(command, capture_output=True, text=True, check=True, env=environment).stdout.strip()
        return {"authorization": f"Bearer {token}"}

    mine, reader, theirs, admin = key("mine", "run"), key("mine", "read"), key("theirs", "run"), key("ops", "admin")
    client = serve().client
    network = client.post("/v1/networks", content=NET, headers=XML | mine).json()
    path = f"/v1/networks/{network['id']}"
    assert client.post("/v1/networks", content=NET, headers=XML).status_code == 401
    assert client.post("/v1/networks", content=NET, headers=XML | reader).status_code == 403
    assert client.delete(path, headers=reader).status_code == 403
    assert client.get(path, headers=theirs).status_code == 404
    assert client.delete(path, headers=theirs).status_code == 404
    assert client.get("/v1/networks", headers=theirs).json()["items"] == []
    for allowed in (mine, reader, admin):
        assert client.get(path, headers=allowed).json() == network
        assert client.get("/v1/networks", headers=allowed).json()["items"] == [network]
    assert client.delete(path, headers=mine).status_code == 204
