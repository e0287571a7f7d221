"""The server's end of the storage; here a folder, elsewhere a bucket: `tests/integration/test_ray.py`."""

from dataclasses import replace
from pathlib import Path

import pytest

from risk_sac.execution.ray.exchange import Exchange
from risk_sac.execution.ray.storage import BESIDE, FENCE, MANIFEST, SEED, Place, Publisher, adopt
from risk_sac.execution.ray.words import Order


@pytest.fixture
def order(tmp_path: Path) -> Order:
    folder = tmp_path / "run"
    folder.mkdir()
    return Order(
        number=1, attempt=1, token="t1", spec="{}", folder=str(folder), scratch="/nowhere/run", arguments=(), beside={},
        environment={}, log="log", hear=None, lease_s=None, stall_s=None, linger_s=None,
    )  # fmt: skip


@pytest.fixture
def storage(tmp_path: Path) -> str:
    return f"file://{tmp_path}/storage"


def publish(url: str, folder: Path, **files: str) -> None:
    """What a node does."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    Publisher(folder, Place(url)).publish(list(files))


def test_an_attempt_begins_with_what_the_run_has_and_what_it_leaves_comes_into_the_runs_folder(
    order, storage, tmp_path
):
    folder = Path(order.folder)
    (folder / "checkpoint").write_text("3")
    exchange = Exchange(storage, order)
    url = exchange.begin()
    adopt(Place(url), SEED, tmp_path / "node", {})
    assert (tmp_path / "node" / "checkpoint").read_text() == "3"
    publish(url, tmp_path / "node", checkpoint="4")
    assert exchange.take()
    assert (folder / "checkpoint").read_text() == "4"
    publish(url, tmp_path / "node", checkpoint="5", results="all")
    exchange.end()
    assert (folder / "checkpoint").read_text() == "5"
    assert (folder / "results").read_text() == "all"
    assert [path for path in (tmp_path / "storage").rglob("*") if path.is_file()] == []


def test_files_and_folders_beside_the_run_come_along_by_their_place_on_the_node(order, storage, tmp_path):
    (tmp_path / "library").mkdir()
    (tmp_path / "library" / "net.xml").write_text("<net/>")
    (tmp_path / "egos.toml").write_text("[pilot]")
    beside = {"places/stretch": str(tmp_path / "library"), "egos.toml": str(tmp_path / "egos.toml")}
    url = Exchange(storage, replace(order, beside=beside)).begin()
    adopt(Place(url), BESIDE, tmp_path / "node", {})
    assert (tmp_path / "node" / "places" / "stretch" / "net.xml").read_text() == "<net/>"
    assert (tmp_path / "node" / "egos.toml").read_text() == "[pilot]"


def test_what_an_earlier_server_left_is_taken_over_first(order, storage, tmp_path):
    url = Exchange(storage, order).begin()
    publish(url, tmp_path / "node", checkpoint="9")
    later = Exchange(storage, replace(order, attempt=2, token="t2"))
    assert later.begin() != url
    assert (Path(order.folder) / "checkpoint").read_text() == "9"
    assert not Place(url).has(MANIFEST)


def test_an_attempt_that_is_given_up_writes_nothing_more(order, storage, tmp_path):
    exchange = Exchange(storage, order)
    url = exchange.begin()
    publish(url, tmp_path / "node", checkpoint="late")
    exchange.close()
    assert not exchange.take()
    exchange.end()
    assert list(Path(order.folder).glob("check*")) == []
    assert Place(url).has(FENCE)  # whoever comes next tidies up
    given_up = Exchange(storage, order)
    given_up.close()
    assert given_up.begin() is None


def test_an_attempt_that_could_not_begin_removes_nothing(order, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "precious").touch()
    monkeypatch.chdir(tmp_path / "here")
    Path(order.folder).rmdir()
    exchange = Exchange(f"file://{tmp_path}/storage", order)  # whose key cannot be written into the run's folder
    with pytest.raises(OSError, match="No such file"):
        exchange.begin()
    exchange.end()
    assert (tmp_path / "here" / "precious").exists()
