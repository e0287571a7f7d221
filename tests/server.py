"""A real server process of the tests' own."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import httpx

from tests.ports import free_port

ROOT = Path(__file__).parents[1]
SCRIPTED = ROOT / "tests" / "integration"  # workers that do what a test needs
LONG_S = 600.0  # what has not happened by then never will, however busy the machine


class Service:
    """Server process on a free loopback port, with its output in `log`."""

    def __init__(
        self, data_dir: Path, worker_module: str, environment: Mapping[str, str], settings: Mapping[str, object]
    ) -> None:
        self.data_dir = data_dir
        self.log = data_dir.with_name(f"{data_dir.name}.log")
        self.port = free_port()
        self.environment = os.environ | {
            "PYTHONPATH": os.pathsep.join([str(ROOT), str(SCRIPTED), os.environ.get("PYTHONPATH", "")]),
            "MALLOC_ARENA_MAX": "2",  # as `risk-sac serve` sets it
            "RISK_SAC_DATA_DIR": str(data_dir),
            "RISK_SAC_PORT": str(self.port),
            "RISK_SAC_MAX_WORKERS": "2",
            "RISK_SAC_WORKER_MODULE": worker_module,
            "RISK_SAC_REPLAYS": "0",  # they would be most of a test's time; tests of them override it
            **{f"RISK_SAC_{name.upper()}": str(value) for name, value in settings.items()},
            **environment,
        }
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.port}", timeout=120)
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        assert self.launch(), f"the server died: {self.log.read_text()[-2000:]}"

    def launch(self) -> bool:
        """Start it; False if it refuses."""
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "service"], cwd=ROOT, env=self.environment, stderr=log
            )
        self.wait_until(lambda: self.process.poll() is not None or self._answers(), alive=False)
        return self.process.poll() is None

    def stop(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(LONG_S)

    def post(self, **spec: Any) -> str:
        response = self.client.post("/v1/campaigns", json={"families": ["low"], "methods": ["random"]} | spec)
        assert response.status_code == 202, response.text
        return response.json()["id"]

    def get(self, campaign_id: str, part: str = "", **query: Any) -> dict[str, Any]:
        response = self.client.get(f"/v1/campaigns/{campaign_id}{part}", params=query)
        assert response.status_code == 200, response.text
        return response.json()

    def wait(self, campaign_id: str, timeout_s: float = LONG_S) -> dict[str, Any]:
        """The campaign, once it has ended."""
        return self.wait_for(campaign_id, lambda seen: seen["state"] in ("succeeded", "failed", "cancelled"), timeout_s)

    def wait_for(
        self, campaign_id: str, holds: Callable[[dict[str, Any]], bool], timeout_s: float = LONG_S
    ) -> dict[str, Any]:
        self.wait_until(lambda: holds(self.get(campaign_id)), timeout_s)
        return self.get(campaign_id)

    def wait_until(self, holds: Callable[[], bool], timeout_s: float = LONG_S, *, alive: bool = True) -> None:
        deadline = time.monotonic() + timeout_s
        while not holds():
            assert not alive or self.process.poll() is None, f"the server died: {self.log.read_text()[-2000:]}"
            assert time.monotonic() < deadline, "it did not happen in time"
            time.sleep(0.03)

    def episodes(self, campaign_id: str, run: str) -> list[int]:
        return [item["index"] for item in self.get(campaign_id, "/episodes", run=run, limit=500)["items"]]

    def episode_ids(self, campaign_id: str) -> list[str]:
        """Ids of all its episodes, in the order of their arrival."""
        ids: list[str] = []
        cursor: dict[str, str] = {}
        while True:
            page = self.get(campaign_id, "/episodes", limit=500, **cursor)
            ids += [item["id"] for item in page["items"]]
            if page["next"] is None:
                return ids
            cursor = {"cursor": page["next"]}

    def workers(self, campaign_id: str = "") -> list[int]:
        """Returns processes that execute runs of this server, or of one campaign."""
        folder = f"{self.data_dir}/campaigns/{campaign_id}".encode()
        found = []
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if entry.name.isdigit() and folder in (entry / "cmdline").read_bytes():
                    found.append(int(entry.name))
        return found

    def _answers(self) -> bool:
        try:
            return self.client.get("/healthz").status_code == 200
        except httpx.TransportError:
            return False


@contextlib.contextmanager
def servers(folder: Path, **common: object) -> Iterator[Callable[..., Service]]:
    """Starts servers with the common settings, and stops them at the end."""
    services: list[Service] = []

    def start(
        worker_module: str = "scripted_worker",
        data_dir: Path | None = None,
        environment: Mapping[str, str] = MappingProxyType({}),
        started: bool = True,
        **settings: object,
    ) -> Service:
        every = {"grace_s": 10} | common | settings
        services.append(Service(data_dir or folder / "data", worker_module, environment, every))
        if started:
            services[-1].start()
        return services[-1]

    try:
        yield start
    finally:
        for service in services:
            if service.process is not None and service.process.poll() is None:
                service.stop()
            service.client.close()
