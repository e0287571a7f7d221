import time
from pathlib import Path

import pytest

from service.errors import StorageError
from service.networks import scenarios, surveys
from service.networks.network_store import NetworkStore
from service.networks.schemas import PLACES, Places
from service.networks.surveys import Surveys
from tests.hostile_networks import NET
from tests.server import LONG_S


@pytest.fixture
def store(tmp_path):
    return NetworkStore(tmp_path / "networks")


@pytest.fixture
def network(store):
    with store.receive() as incoming:
        incoming.write(NET.encode())
        return store.add(incoming, "default", "")


@pytest.fixture
def searching(store, tmp_path):
    searches = Surveys(store, tmp_path / "library")
    yield searches
    searches.stop()


def flip(file: Path) -> None:
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)


def test_who_asks_too_early_is_told_of_the_progress(searching, network, monkeypatch):
    monkeypatch.setattr(surveys, "PATIENCE_S", 0.0)
    assert searching.places(network.id, None) == Places(items=[], elsewhere=[], progress=0.0)
    deadline = time.monotonic() + LONG_S
    while (found := searching.places(network.id, None)).progress < 1:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert [each.place for each in found.elsewhere] == ["road"]
    assert set(found.nowhere) == {"crossing", "junction"}


def test_damage_of_a_net_is_told_as_the_services_and_that_of_places_is_mended(searching, store, network):
    found = searching.places(network.id, None)
    folder = store.folder(network.id, None)
    flip(folder / PLACES)
    assert searching.places(network.id, None) == found
    flip(folder / "net.xml")
    assert searching.places(network.id, None) == found
    (folder / PLACES).unlink()
    for ask in (
        lambda: searching.places(network.id, None),
        lambda: searching.keep(network.id, None, "car_following", "road"),
    ):
        with pytest.raises(StorageError, match=f"network {network.id} is damaged: net.xml is not as it was written"):
            ask()


SLEEPS = """
import time
open("begun", "w").close()
time.sleep(600)
"""


def test_a_search_ends_when_the_service_stops(store, network, tmp_path, monkeypatch):
    (tmp_path / "helper.py").write_text(SLEEPS)
    monkeypatch.setattr(scenarios, "HELPER", str(tmp_path / "helper.py"))
    begun = store.folder(network.id, None) / "begun"
    with pytest.raises(StorageError, match="places cannot be looked for"):
        Surveys(store, tmp_path / "places", begun.exists).places(network.id, None)
