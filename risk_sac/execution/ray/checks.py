"""What has to hold before the first run is ordered, told with the setting that is to blame."""

import contextlib
import logging
import secrets
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayError, RayTaskError

from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Node
from risk_sac.execution.postmortem import without_folders
from risk_sac.execution.ray.settings import RaySettings, variable
from risk_sac.execution.ray.storage import Place, without_secrets
from risk_sac.execution.ray.tasks import on_node
from risk_sac.execution.ray.versions import Versions, differing, versions

logger = logging.getLogger(__name__)

PROBE_S = 60.0
ADDRESS, STORAGE = variable("ray_address"), variable("ray_storage")
PROBE, WRITTEN = "probe-", b"server"


def check(settings: RaySettings, within: Path | None) -> None:
    """Tries every node: its versions, its folder, its way to the storage.

    Args:
      settings: of this process.
      within: folder that holds those of all runs, which is the storage where the settings name none; None leaves it
        untried then.

    Raises:
      ConfigError: one cannot do what it will have to.
    """
    able = [node for node in nodes(ray.nodes(), settings) if node.alive and node.slots]
    if not able:
        raise ConfigError(
            variable("ray_cpus_per_run"),
            f"{settings.ray_cpus_per_run:g} processors and {settings.ray_memory_bytes_per_run} bytes for a run",
            "what some node of the cluster has",
        )
    with _probed_storage(settings, within) as probe:
        asked = [(node.address, on_node(_tried, node.id).remote(probe, settings.ray_scratch_dir)) for node in able]
        expected = versions()
        tried = [_check_node(address, reference, expected, probe, settings) for address, reference in asked]
    if not any(tried):
        addresses = ", ".join(node.address for node in able)
        raise ConfigError(ADDRESS, f"all nodes were lost while they were tried: {addresses}")


def nodes(found: Iterable[dict[str, Any]], settings: RaySettings) -> list[Node]:
    """What Ray says of its nodes, in runs."""
    listed = []
    for each in found:
        resources = each.get("Resources", {}) if each["Alive"] else {}
        slots = int(resources.get("CPU", 0) / settings.ray_cpus_per_run + 1e-9)
        if settings.ray_memory_bytes_per_run:
            slots = min(slots, int(resources.get("memory", 0) / settings.ray_memory_bytes_per_run))
        listed.append(
            Node(id=each["NodeID"], address=each["NodeManagerAddress"], alive=bool(each["Alive"]), slots=slots)
        )
    return listed


@dataclass(frozen=True, slots=True)
class _Probe:
    """A file that the server has put into the storage, for nodes to find."""

    url: str
    name: str
    given: str  # how the user knows the storage

    def refused(self, who: str, why: object) -> ConfigError:
        return ConfigError(
            STORAGE,
            f"{self.given}, which {who} cannot use ({without_folders(_first(why))})",
            "a folder or bucket that the server and all nodes read and write",
        )


@contextlib.contextmanager
def _probed_storage(settings: RaySettings, within: Path | None) -> Iterator[_Probe | None]:
    name = f"{PROBE}{secrets.token_hex(8)}"
    if settings.ray_storage is not None:
        probe = _Probe(settings.ray_storage, name, f"got {without_secrets(settings.ray_storage)!r}")
    elif within is not None:
        within.mkdir(parents=True, exist_ok=True, mode=0o700)
        url = f"file://{within.resolve()}"
        probe = _Probe(url, name, f"got nothing, so that runs are exchanged through {str(within)!r}")
    else:
        yield None
        return
    try:
        place = Place(probe.url)
        place.write(name, WRITTEN)
    except (OSError, ImportError, ValueError) as error:
        raise probe.refused("this machine", error) from error
    try:
        yield probe
    finally:
        with contextlib.suppress(OSError):  # what is wrong has been said
            place.remove(name)


@dataclass(frozen=True, slots=True)
class _Found:
    """What a node says of itself."""

    versions: Versions
    scratch: str | None = None  # what kept it from its folder for runs, and from the storage; None: nothing did
    storage: str | None = None


def _tried(probe: _Probe | None, scratch_dir: Path) -> _Found:
    """Executed on a node."""
    try:
        scratch_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
        tempfile.TemporaryFile(dir=scratch_dir).close()
    except OSError as error:
        return _Found(versions(), scratch=str(error))
    if probe is None:
        return _Found(versions())
    try:
        place = Place(probe.url)
        if place.read(probe.name) != WRITTEN:  # first, so that nothing is made in a folder that is another one
            raise OSError("it holds something else than what the server has just written")
        own = f"{probe.name}-{ray.get_runtime_context().get_node_id()}"
        place.write(own, b"node")
        place.remove(own)
    except FileNotFoundError:
        return _Found(versions(), storage="what the server has just written is not to be seen there")
    except (OSError, ImportError, ValueError) as error:
        return _Found(versions(), storage=f"{type(error).__name__}: {error}")
    return _Found(versions())


def _check_node(address: str, reference: Any, expected: Versions, probe: _Probe | None, settings: RaySettings) -> bool:
    """Refuses what a node says; False if it says nothing, since it was lost, which the head tells after a while."""
    try:
        found: _Found = ray.get(reference, timeout=PROBE_S)
    except GetTimeoutError as error:
        raise ConfigError(ADDRESS, f"node {address} does not answer within {PROBE_S:g} s") from error
    except RayTaskError as error:
        wanted = f"risk-sac {expected['risk-sac']} and all that belongs to it, as on the server's machine"
        raise ConfigError(
            ADDRESS, f"node {address}, which cannot run what is here ({_first(error.cause)})", wanted
        ) from error
    except RayError as error:
        logger.warning("node %s was lost: %s", address, _first(error))
        return False
    other = differing(found.versions, expected)
    if other:
        raise ConfigError(ADDRESS, f"on node {address}: {other}")
    if found.scratch is not None:
        raise ConfigError(
            variable("ray_scratch_dir"),
            f"{str(settings.ray_scratch_dir)!r}, which node {address} cannot write to "
            f"({without_folders(_first(found.scratch))})",
            "a folder that every node makes for itself",
        )
    if found.storage is not None:
        assert probe is not None
        raise probe.refused(f"node {address}", found.storage)
    return True


def _first(error: object) -> str:
    return str(error).strip().partition("\n")[0] or type(error).__name__
