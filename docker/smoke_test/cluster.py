"""The service on a Ray cluster: a head, two nodes and the server, each on a network address of its own.

They are what `docker/compose.yaml` starts with its profile `ray`, as processes in network namespaces, which need no
engine, no image and no privilege beyond root's. All see the same files, as containers with one volume do, but for the
folder in which Ray keeps its sockets and the addresses of a machine.
"""

import contextlib
import os
import secrets
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import yaml

from smoke_test.api import ANSWER_S, Api
from smoke_test.engines import HERE
from smoke_test.errors import NoEngineError, SmokeError
from smoke_test.namespaces import Hosts

HEAD, SERVER, NODES = "head", "server", ("node-1", "node-2")
PORT, RAY_PORT = 8000, 6379
START_S = 120.0
CAMPAIGN_S = 400.0
CAMPAIGN = {"families": ["low"], "methods": ["random"], "seeds": [1, 2], "budget": {"episodes": 6}}
# Ray starts no more than it needs: the machine may be a small one.
FRUGAL = ["--disable-usage-stats", "--object-store-memory=80000000", "--include-log-monitor=false", "--block"]


def check_possible() -> None:
    """Whether the case can be tried here.

    Raises:
      NoEngineError: it cannot, and why.
    """
    lacking = [
        *(["root"] if os.geteuid() != 0 else []),
        *(["`ip` of iproute2"] if shutil.which("ip") is None else []),
        *(f"{name} in {sys.executable}" for name in ("ray", "libsumo", "fastapi") if find_spec(name) is None),
    ]
    if lacking:
        raise NoEngineError(f"a cluster in network namespaces needs {', '.join(lacking)}")
    try:
        with Hosts((HEAD,)):
            pass
    except subprocess.CalledProcessError as error:
        raise NoEngineError(f"network namespaces cannot be made here: {error.stderr.strip()}") from error


class ClusterStory:
    """One pass through everything; each step raises a SmokeError where it is not as it should be."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "cluster"
        self._folder.mkdir()
        self._document = yaml.safe_load((HERE.parent / "openapi.yaml").read_text(encoding="utf-8"))
        self._hosts = Hosts((HEAD, SERVER, *NODES))
        self._temp = Path("/tmp") / f"rs-{secrets.token_hex(4)}"  # of Ray: the paths of its sockets must be short
        self._temp.mkdir()
        # `ip netns exec` has its own mounts; in there this is nobody else's.
        self._own_temp = ["sh", "-c", 'mount -t tmpfs none "$0" && exec "$@"', str(self._temp)]
        self._environment = {
            "RAY_AUTH_MODE": "token",
            "RAY_AUTH_TOKEN": secrets.token_hex(16),
            "PYTHONPATH": str(HERE.parent),
            "OMP_NUM_THREADS": "1",
        }

    def told(self) -> str:
        """What was seen.

        Raises:
          SmokeError: something else was.
        """
        try:
            with self._hosts:
                with self._cluster():
                    refusal = self._refused_without_token()
                    there = self._campaign("ray", **self._ray())
                here = self._campaign("local", RISK_SAC_EXECUTOR="local")
        finally:
            shutil.rmtree(self._temp, ignore_errors=True)
        if len(there["nodes"]) != len(NODES):
            raise SmokeError(f"the service knows the nodes {there['nodes']}; wanted {len(NODES)} with room for runs")
        if there["digests"] != here["digests"]:
            raise SmokeError(f"results on the cluster are {there['digests']}; locally they are {here['digests']}")
        return (
            f"{len(there['digests'])} runs on {len(there['nodes'])} nodes of a Ray cluster in network namespaces, with "
            f"the digests that they have locally; without a token the service refuses: {refusal}"
        )

    def _ray(self) -> dict[str, str]:
        return {
            "RISK_SAC_EXECUTOR": "ray",
            "RISK_SAC_RAY_ADDRESS": f"{self._hosts.addresses[HEAD]}:{RAY_PORT}",
            "RISK_SAC_RAY_JOIN": "true",
            "RISK_SAC_RAY_MEMORY_BYTES_PER_RUN": "0",
            "RISK_SAC_RAY_SCRATCH_DIR": str(self._folder / "scratch"),
        }

    @contextlib.contextmanager
    def _cluster(self) -> Iterator[None]:
        address = self._hosts.addresses[HEAD]
        with contextlib.ExitStack() as ended:
            first = ["--head", f"--node-ip-address={address}", f"--port={RAY_PORT}", "--num-cpus=0"]
            first += ["--include-dashboard=false", "--no-monitor", f"--temp-dir={self._temp}"]
            ended.enter_context(self._node(HEAD, first))
            for name in NODES:
                ended.enter_context(self._node(name, [f"--address={address}:{RAY_PORT}", "--num-cpus=1"]))
            yield

    @contextlib.contextmanager
    def _node(self, name: str, arguments: list[str]) -> Iterator[None]:
        """A node, once it says that it has started."""
        log = self._folder / f"{name}.log"
        command = [sys.executable, "-m", "ray.scripts.scripts", "start", *arguments, *FRUGAL]
        with self._started(name, command, log, {}) as process:
            end = time.monotonic() + START_S
            while "Ray runtime started" not in log.read_text():
                if process.poll() is not None or time.monotonic() > end:
                    raise SmokeError(f"the {name} of the Ray cluster does not start: {log.read_text()[-2000:]}")
                time.sleep(0.1)
            yield

    @contextlib.contextmanager
    def _started(
        self, host: str, command: list[str], log: Path, more: Mapping[str, str]
    ) -> Iterator["subprocess.Popen[bytes]"]:
        with log.open("ab") as output:
            process = subprocess.Popen(
                [*self._hosts.on(host), *self._own_temp, *command],
                env=os.environ | self._environment | more,
                stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True,
            )  # fmt: skip
        try:
            yield process
        finally:
            process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(START_S)
            for pid in self._hosts.processes(host):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            process.wait()

    def _refused_without_token(self) -> str:
        """The first line that the service says of a cluster that anybody could use."""
        result = subprocess.run(
            [*self._hosts.on(SERVER), *self._own_temp, sys.executable, "-m", "service"],
            env=os.environ | self._environment | self._ray() | {"RAY_AUTH_MODE": "disabled"},
            cwd=self._folder, capture_output=True, text=True, timeout=START_S, check=False,
        )  # fmt: skip
        said = [line for line in result.stderr.splitlines() if "RAY_AUTH_MODE" in line]
        if result.returncode == 0 or not said:
            raise SmokeError(f"the service took a cluster without a token: {result.stderr[-2000:]}")
        return said[0]

    def _campaign(self, name: str, **environment: str) -> dict[str, Any]:
        """A server, and what it makes of the campaign."""
        data, log = self._folder / name, self._folder / f"{name}.log"
        settings = {"RISK_SAC_DATA_DIR": str(data), "RISK_SAC_PORT": str(PORT), "RISK_SAC_REPLAYS": "0"}
        api = Api(f"http://127.0.0.1:{PORT}", None, self._document)
        with self._started(SERVER, [sys.executable, "-m", "service"], log, settings | environment) as server:
            try:
                with self._hosts.visited(SERVER):
                    api.wait_ready(START_S)
                    seen = self._executed(api)
                server.terminate()
                server.wait(START_S)
                left = self._hosts.processes(SERVER)
            except Exception:
                print(f"smoke: the server's log ends with:\n{log.read_text()[-3000:]}")
                raise
        if "shutdown complete" not in log.read_text() or left:
            raise SmokeError(f"the server ended with {server.returncode} and left {len(left)} processes behind")
        return seen

    def _executed(self, api: Api) -> dict[str, Any]:
        campaign = api.post("/v1/campaigns", CAMPAIGN, status=202)["id"]
        nodes = _nodes()
        end = time.monotonic() + CAMPAIGN_S
        while (state := api.get("/v1/campaigns/{campaign_id}", campaign_id=campaign)["state"]) in ("queued", "running"):
            if time.monotonic() > end:
                raise SmokeError(f"waited {CAMPAIGN_S:.0f} s for a campaign on the cluster")
            time.sleep(0.5)
        if state != "succeeded":
            raise SmokeError(f"the campaign on the cluster has {state}")
        results = api.get("/v1/campaigns/{campaign_id}/results", campaign_id=campaign)
        return {"digests": {run["id"]: run["digest"] for run in results["runs"]}, "nodes": nodes}


def _nodes() -> list[str]:
    """Of the cluster, those that have room for runs, as the service's metrics have them."""
    with urllib.request.urlopen(f"http://127.0.0.1:{PORT}/metrics", timeout=ANSWER_S) as response:
        lines = response.read().decode().splitlines()
    slots = [line.rpartition(" ") for line in lines if line.startswith("risk_sac_node_slots{")]
    return [name for name, _, number in slots if float(number) > 0]
