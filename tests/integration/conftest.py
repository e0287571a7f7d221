"""Real server processes with a real database."""

import importlib.util
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType
from typing import Any

import httpx
import pytest

from service.settings import ServiceSettings
from tests.contract.serving import serving
from tests.server import LONG_S, SCRIPTED, Service, servers


@pytest.fixture(scope="session")
def scripted() -> ModuleType:
    """The scripted worker, for the seeds that tell it what to do."""
    spec = importlib.util.spec_from_file_location("scripted_worker", SCRIPTED / "scripted_worker.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """Starts a server for tests that read only what they posted."""
    with servers(tmp_path_factory.mktemp("scripted")) as start:
        yield start()


@pytest.fixture(scope="session")
def striking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """The same with workers that find failures, and with little patience."""
    with servers(tmp_path_factory.mktemp("striking")) as start:
        yield start("striking_worker", attempts=2)


@pytest.fixture(scope="session")
def real(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """The same with real workers."""
    with servers(tmp_path_factory.mktemp("real")) as start:
        yield start("risk_sac.execution.worker", grace_s=30)


@pytest.fixture(scope="module")
def service(real: Service) -> Service:
    """The server of a module that names no other."""
    return real


@pytest.fixture(scope="module")
def campaign(request: pytest.FixtureRequest, service: Service) -> dict[str, Any]:
    """The campaign of the module's `SPEC`, once it has succeeded."""
    ended = service.wait(service.post(**request.module.SPEC))
    assert ended["state"] == "succeeded", ended["reason"]
    return ended


@pytest.fixture(scope="module")
def client(shared: Service) -> httpx.Client:
    """A client of the scripted server."""
    return shared.client


class Inside(Service):
    """A server within this process whose runs wait until they are cancelled."""

    def __init__(self, url: str, data_dir: Path) -> None:
        self.data_dir = data_dir
        self.client = httpx.Client(base_url=url, timeout=120)
        self.port = self.client.base_url.port

    def wait_until(self, holds: Callable[[], bool], timeout_s: float = LONG_S, *, alive: bool = False) -> None:
        """Waits; there is no process to watch."""
        super().wait_until(holds, timeout_s, alive=False)


@pytest.fixture
def serve_inside(tmp_path: Path) -> Iterator[Callable[..., Inside]]:
    """Starts servers within this process and stops them after the test."""
    with ExitStack() as stack:

        def start(**settings: object) -> Inside:
            given = {"data_dir": tmp_path / "data"} | settings
            service = Inside(stack.enter_context(serving(ServiceSettings.model_validate(given))), tmp_path / "data")
            stack.callback(service.client.close)
            return service

        yield start


@pytest.fixture
def serve(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[..., Service]]:
    """Starts servers and stops them after the test; PostgreSQL by the parameter."""
    with servers(tmp_path, **database(request)) as start:
        yield start


@pytest.fixture(scope="module")
def serve_shared(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[..., Service]]:
    """Starts servers and stops them at the end of the module."""
    with servers(tmp_path_factory.mktemp("shared"), **database(request)) as start:
        yield start


def database(request: pytest.FixtureRequest) -> dict[str, str]:
    """Returns the setting of a new database of the parameter's kind."""
    if getattr(request, "param", "sqlite") == "postgresql":
        return {"database_url": request.getfixturevalue("postgresql").new_database()}
    return {}
