import gc
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.postgresql import PostgreSql, binaries, running

# The first example pays for torch's lazy imports and for compilation, whichever it is.
settings.register_profile("first call may compile", deadline=None)
settings.load_profile("first call may compile")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[object]:  # None of the thousands of tests is garbage.
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts unit tests last: many short files end all processes together."""
    items.sort(key=lambda item: item.nodeid.startswith("tests/unit/"))


@pytest.fixture(scope="session", autouse=True)
def every_failure_is_clean(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Checks the session's run folders: no bodies overlap before valid contacts."""
    yield
    unclean = {}
    for results in tmp_path_factory.getbasetemp().rglob("results.json"):
        from tests.overlaps import overlaps_before_valid_contacts  # here, because few sessions play anything

        unclean |= overlaps_before_valid_contacts(results)
    assert not unclean


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgreSql]:
    """Starts a PostgreSQL server; skips tests where it is not installed."""
    bin_ = binaries()
    if bin_ is None:
        pytest.skip("PostgreSQL is not installed")
    with running(bin_) as server:
        yield server


@pytest.fixture
def steering_egos(monkeypatch: pytest.MonkeyPatch) -> None:
    """Registers the egos of tests/egos, in this process and its children."""
    folder = str(Path(__file__).parent / "egos")
    monkeypatch.syspath_prepend(folder)
    others = os.environ.get("PYTHONPATH")
    monkeypatch.setenv("PYTHONPATH", folder if not others else os.pathsep.join((folder, others)))
