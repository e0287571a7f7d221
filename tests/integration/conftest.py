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
def shared(serve_shared: Callable[..., Service]) -> Service:
    """One server for all tests of a module that look at nothing but what they posted themselves."""
    return serve_shared()


@pytest.fixture(scope="module")
def client(shared: Service) -> httpx.Client:
    """A client of it."""
    return shared.client


@pytest.fixture
def serve(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[..., Service]]:
    """Starts servers and stops them at the end of the test; on PostgreSQL where the parameter says so."""
    with servers(tmp_path, **database(request)) as start:
        yield start


@pytest.fixture(scope="module")
def serve_shared(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., Service]]:
    """The same, at the end of the module."""
    with servers(tmp_path_factory.mktemp("shared"), **database(request)) as start:
        yield start


def database(request: pytest.FixtureRequest) -> dict[str, str]:
    """The setting of a new database of the kind that the parameter names."""
    if getattr(request, "param", "sqlite") == "postgresql":
        return {"database_url": request.getfixturevalue("postgresql").new_database()}
    return {}
