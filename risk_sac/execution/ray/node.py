"""Order of an attempt at a run; a node's versions and folders."""

import contextlib
import os
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from risk_sac.config import RunSpec
from risk_sac.egos import registry
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import WorkerProgram
from risk_sac.execution.messages import without_folders
from risk_sac.execution.ray import ADDRESS, RaySettings, variable
from risk_sac.run_folder.durable import replace_file
from risk_sac.scenario import library

EGOS, PLACES = "egos.toml", "places"  # names of what processes read beside the run's folder
Files = Mapping[str, bytes]  # by their paths in a folder, the oldest first
# What results depend on, besides Python and egos: the same on the server's machine and on all nodes.
PACKAGES = ("risk-sac", "ray", "libsumo", "torch", "botorch", "gpytorch", "rtamt", "numpy")
MISSING = "missing"

Versions = Mapping[str, str]


@dataclass(slots=True, kw_only=True)
class Order:
    """An attempt at a run."""

    number: int
    spec: RunSpec
    slots: int
    program: WorkerProgram
    folder: Path  # of the run, on the server's machine
    scratch: Path  # of this attempt and no other, on its node
    beside: Mapping[str, Path]  # what its processes read beside the run's folder, by its path in their scratch folder
    settings: RaySettings
    told_to_stop: bool = False

    @property
    def id(self) -> str:
        """Unique id of the attempt, across this and earlier servers."""
        return self.scratch.name

    def environment(self, scratch: Path) -> dict[str, str]:
        """Returns variables of its processes that read `beside` in a scratch folder."""
        egos = str(scratch / EGOS) if EGOS in self.beside else ""  # whatever a node registers by itself does not count
        placed = any(name.startswith(f"{PLACES}/") for name in self.beside)
        return {registry.FILE: egos} | ({library.VARIABLE: str(scratch / PLACES)} if placed else {})


def check(scratch: Path, expected: Versions) -> None:
    """Checks this node's versions, and its folder for attempts.

    Raises:
      ConfigError: it has other versions than the server's machine, or cannot use the folder.
    """
    import ray

    node = f"node {ray.util.get_node_ip_address()}"
    if other := differing(versions(), expected):
        raise ConfigError(ADDRESS, f"on {node}: {other}")
    try:
        scratch.mkdir(parents=True, exist_ok=True, mode=0o700)
        tempfile.TemporaryFile(dir=scratch).close()
        if scratch.stat().st_uid != os.getuid():
            raise PermissionError("it belongs to another user")
    except OSError as error:
        got = f"{str(scratch)!r}, which {node} cannot write to ({without_folders(str(error))})"
        raise ConfigError(variable("ray_scratch_dir"), got, "a folder that every node makes for itself") from error


def signatures(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Returns inode, size and time of each file, by its relative path."""
    signature_by_path = {}
    for parent, _, names in os.walk(folder):
        for name in names:
            path = Path(parent, name)
            if not name.endswith(".tmp") and name != ".lock":
                with contextlib.suppress(FileNotFoundError):
                    status = path.stat()
                    signature_by_path[str(path.relative_to(folder))] = status.st_ino, status.st_size, status.st_mtime_ns
    return signature_by_path


def read(folder: Path) -> Files:
    """All files of a folder that an attempt may read or write."""
    return {name: (folder / name).read_bytes() for name in signatures(folder)}


def write(folder: Path, files: Files) -> None:
    """Writes files, each whole or not at all."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, content)


def versions() -> Versions:
    """Returns the versions of Python, packages and installed egos here."""
    version_by_name = {"python": ".".join(map(str, sys.version_info[:3]))}
    for name in PACKAGES:
        try:
            version_by_name[name] = version(name)
        except PackageNotFoundError:
            version_by_name[name] = MISSING
    return version_by_name | {f"the ego {name}": version for name, version in registry.installed().items()}


def differing(actual: Versions, expected: Versions) -> str:
    """Lists the versions that differ from the server's machine, in words.

    Returns "" if none differs.

    An ego that is installed here alone is no difference: no campaign can name it.
    """
    other = [
        f"{name} is {actual.get(name, MISSING)}; wanted {wanted}"
        for name, wanted in expected.items()
        if actual.get(name, MISSING) != wanted
    ]
    return f"{', '.join(other)}, as on the server's machine" if other else ""
