import re
import shutil

import pytest

from service.errors import BusyError, ConflictError, NotFoundError, QuotaError, StorageError
from service.networks.network_store import INCOMING, RECORD, NetworkStore
from service.networks.schemas import Network
from tests.hostile_networks import NET


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "networks"


@pytest.fixture
def shelf(folder):
    return NetworkStore(folder, most=5)


def add(shelf: NetworkStore, project: str = "default", label: str = "", content: str = NET) -> Network:
    with shelf.receive() as incoming:
        incoming.write(content[:50].encode())
        incoming.write(content[50:].encode())
        return shelf.add(incoming, project, label)


def test_a_network_is_kept_as_it_was_described(shelf, folder):
    network = add(shelf, label="ring road")
    assert (network.label, network.edges, network.bytes) == ("ring road", 1, len(NET))
    assert re.fullmatch("n[0-9a-f]{16}", network.id)
    assert shelf.get(network.id, "default") == network
    assert sorted(path.name for path in (folder / "default" / network.id).iterdir()) == ["net.xml", RECORD]
    assert NetworkStore(folder).get(network.id, None) == network  # another server, later


def test_no_project_sees_another_ones(shelf):
    mine, theirs = add(shelf, "mine"), add(shelf, "theirs")
    assert [network.id for network in shelf.list(9, None, "mine").items] == [mine.id]
    assert {network.id for network in shelf.list(9, None, None).items} == {mine.id, theirs.id}
    for forbidden in (shelf.get, shelf.delete):
        with pytest.raises(NotFoundError):
            forbidden(theirs.id, "mine")
    assert shelf.get(theirs.id, "theirs") == theirs


def test_a_project_has_as_many_networks_as_it_may(folder):
    shelf = NetworkStore(folder, most=1)
    network = add(shelf)
    with pytest.raises(ConflictError, match=r"has 1 networks; wanted fewer than 1: delete one first"):
        add(shelf)
    add(shelf, "another")
    shelf.delete(network.id, None)
    add(shelf)


def test_one_key_has_a_part_of_the_places_only(folder):
    shelf = NetworkStore(folder)
    with shelf.receive("mine"), shelf.receive("mine"):
        with pytest.raises(QuotaError, match="2 uploads of this key are at work; wanted fewer"), shelf.receive("mine"):
            pass
        with shelf.receive("theirs"), shelf.receive("theirs"), pytest.raises(BusyError), shelf.receive("third"):
            pass
    with shelf.receive("mine"):
        pass


def test_what_an_earlier_server_left_unfinished_is_removed(shelf, folder):
    network = add(shelf)
    shutil.copytree(folder / "default" / network.id, folder / INCOMING / "left")
    assert NetworkStore(folder).get(network.id, None) == network
    assert not (folder / INCOMING).exists()


def test_a_damaged_record_is_noticed(shelf, folder):
    good, damaged = add(shelf), add(shelf)
    record = folder / "default" / damaged.id / RECORD
    whole = record.read_bytes()
    for at in (0.01, 0.5, 0.9, 0.999):
        content = bytearray(whole)
        content[int(at * len(content))] ^= 1
        record.write_bytes(content)
        with pytest.raises(StorageError, match="is damaged"):
            shelf.get(damaged.id, None)
        assert shelf.list(9, None, None).items == (good,)
    shelf.delete(damaged.id, None)


def test_a_disk_that_refuses_is_a_storage_error(shelf, folder):
    network = add(shelf)
    shutil.rmtree(folder)
    folder.write_text("no folder")
    with pytest.raises(StorageError, match="cannot be received"):
        add(shelf)
    with pytest.raises(NotFoundError):
        shelf.get(network.id, "default")


def test_only_ids_that_were_given_out_are_found(shelf):
    given = add(shelf)
    for name in ("", "..", "../default", "n0", "nffffffffffffffff", ".incoming", "n" + "0" * 16 + "/.."):
        for forbidden in (shelf.get, shelf.delete):
            with pytest.raises(NotFoundError):
                forbidden(name, None)
    assert shelf.get(given.id, None) == given
