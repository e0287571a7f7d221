"""Real server processes with a real database."""

import contextlib
import importlib.util
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import httpx
import pytest

ROOT = Path(__file__).parents[2]
SCRIPTED = Path(__file__).parent


class Service:
    """A server process of our own, on a free loopback port."""

    def __init__(self, data_dir: Path, worker_module: str, grace_s: float) -> None:
        self.data_dir = data_dir
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = probe.getsockname()[1]
        self._environment = os.environ | {
            "PYTHONPATH": os.pathsep.join([str(ROOT), str(SCRIPTED), os.environ.get("PYTHONPATH", "")]),
            "RISK_SAC_DATA_DIR": str(data_dir),
            "RISK_SAC_PORT": str(self.port),
            "RISK_SAC_MAX_WORKERS": "2",
            "RISK_SAC_GRACE_S": str(grace_s),
            "RISK_SAC_WORKER_MODULE": worker_module,
        }
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.port}", timeout=30)
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "service"], cwd=ROOT, env=self._environment, stderr=subprocess.DEVNULL
        )
        self.wait_until(self._answers)

    def stop(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(30)

    def post(self, **spec: Any) -> str:
        response = self.client.post("/v1/campaigns", json={"families": ["low"], "methods": ["random"]} | spec)
        assert response.status_code == 202, response.text
        return response.json()["id"]

    def get(self, campaign_id: str, part: str = "", **query: Any) -> dict[str, Any]:
        response = self.client.get(f"/v1/campaigns/{campaign_id}{part}", params=query)
        assert response.status_code == 200, response.text
        return response.json()

    def wait(self, campaign_id: str) -> dict[str, Any]:
        """The campaign, once it has ended."""
        return self.wait_for(campaign_id, lambda seen: seen["state"] in ("succeeded", "failed", "cancelled"))

    def wait_for(self, campaign_id: str, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        self.wait_until(lambda: holds(self.get(campaign_id)))
        return self.get(campaign_id)

    def wait_until(self, holds: Callable[[], bool], timeout_s: float = 120) -> None:
        deadline = time.monotonic() + timeout_s
        while not holds():
            assert self.process.poll() is None, "the server died"
            assert time.monotonic() < deadline, "it did not happen in time"
            time.sleep(0.03)

    def episodes(self, campaign_id: str, run: str) -> list[int]:
        return [item["index"] for item in self.get(campaign_id, "/episodes", run=run, limit=500)["items"]]

    def workers(self) -> list[int]:
        """Processes that execute runs of this server's data folder."""
        found = []
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if entry.name.isdigit() and f"{self.data_dir}/campaigns/".encode() in (entry / "cmdline").read_bytes():
                    found.append(int(entry.name))
        return found

    def _answers(self) -> bool:
        try:
            return self.client.get("/healthz").status_code == 200
        except httpx.TransportError:
            return False


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
def serve(tmp_path: Path) -> Iterator[Callable[..., Service]]:
    """Starts servers and stops them at the end of the test."""
    yield from _servers(tmp_path)


@pytest.fixture(scope="module")
def serve_shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Service]]:
    """Starts servers and stops them at the end of the module."""
    yield from _servers(tmp_path_factory.mktemp("shared"))


def _servers(folder: Path) -> Iterator[Callable[..., Service]]:
    services: list[Service] = []

    def start(worker_module: str = "scripted_worker", grace_s: float = 10, data_dir: Path | None = None) -> Service:
        services.append(Service(data_dir or folder / "data", worker_module, grace_s))
        return services[-1]

    yield start
    for service in services:
        if service.process.poll() is None:
            service.stop()
        service.client.close()
