"""Real server processes with a real database."""

import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import httpx
import pytest

from tests.server import SCRIPTED, Service, servers


@pytest.fixture(scope="session")
def scripted() -> ModuleType:
    """The scripted worker, for the seeds that tell it what to do."""
    spec = importlib.util.spec_from_file_location("scripted_worker", SCRIPTED / "scripted_worker.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def client(serve_shared: Callable[..., Service]) -> httpx.Client:
    """A client of one server for all tests of a module that leave no trace."""
    return serve_shared().client


@pytest.fixture
def serve(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[..., Service]]:
    """Starts servers and stops them at the end of the test; on PostgreSQL where the parameter says so."""
    common = {}
    if getattr(request, "param", "sqlite") == "postgresql":
        common["database_url"] = request.getfixturevalue("postgresql").new_database()
    with servers(tmp_path, **common) as start:
        yield start


@pytest.fixture(scope="module")
def serve_shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Service]]:
    """Starts servers and stops them at the end of the module."""
    with servers(tmp_path_factory.mktemp("shared")) as start:
        yield start
