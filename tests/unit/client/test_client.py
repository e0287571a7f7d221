import itertools
import subprocess
import sys
from typing import Any

from risk_sac.client import Client
from tests.unit.client.scripted_server import Server, campaign


def test_lists_are_read_page_by_page_as_far_as_they_are_wanted(server: Server, client: Client) -> None:
    pages: list[dict[str, Any]] = [
        {"items": [campaign(id="c3"), campaign(id="c2")], "next": "Mg=="},
        {"items": [campaign(id="c1")], "next": None},
    ]
    for page in pages:
        server.answer(200, page)
    found = client.campaigns(state="running", page=2)
    assert [each.id for each in itertools.islice(found, 2)] == ["c3", "c2"]
    assert len(server.asked) == 1
    assert [each.id for each in found] == ["c1"]
    assert [asked.path for asked in server.asked] == [
        "/v1/campaigns?state=running&limit=2",
        "/v1/campaigns?state=running&limit=2&cursor=Mg%3D%3D",
    ]


def test_an_id_stays_one_part_of_the_path(server: Server, client: Client) -> None:
    server.answer(200, campaign())
    client.campaign("../c1?x=y#z")
    assert server.asked[0].path == "/v1/campaigns/..%2Fc1%3Fx%3Dy%23z"


def test_the_key_is_sent_with_every_request_and_shown_nowhere(server: Server) -> None:
    server.answer(200, campaign())
    with Client(server.url, "rs_secret") as client:
        client.campaign("c1")
        assert "rs_secret" not in repr(client) + str(vars(client))
    assert server.asked[0].headers["authorization"] == "Bearer rs_secret"


def test_a_client_needs_neither_the_method_nor_the_service() -> None:
    heavy = {"torch", "libsumo", "botorch", "numba", "fastapi", "sqlalchemy", "service"}
    code = f"import sys, risk_sac.client; print(sorted({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout == b"[]\n"
