"""What builds and runs the image: docker, podman, or buildah's chroot isolation."""

import os
import resource
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from smoke_test.errors import NoEngineError, SmokeError
from smoke_test.namespaces import own_mounts

HERE = Path(__file__).parents[1]
COMMAND_S = 600.0
NAMES = ("docker", "podman", "chroot")


@dataclass(frozen=True)
class Engine:
    """A program that understands docker's command line."""

    name: str
    program: str
    environment: Mapping[str, str] = field(default_factory=dict)
    build_flags: Sequence[str] = ()
    private: bool = False
    """Its containers live in this process's namespaces, on a network of its own that has a loopback device only."""
    read_only: bool = True
    """Whether it enforces a read-only root file system."""

    def __call__(self, *arguments: str, timeout_s: float = COMMAND_S, log: Path | None = None) -> str:
        """Runs a command to its end; returns what it printed.

        Args:
          arguments: of the program.
          timeout_s: when to give up.
          log: where its standard error goes; by default into the message of the error.

        Raises:
          SmokeError: it failed.
        """
        result = self.attempt(*arguments, timeout_s=timeout_s)
        if log is not None:
            log.write_text(result.stdout + result.stderr)
        if result.returncode != 0:
            raise SmokeError(
                f"{self.name} {' '.join(arguments[:4])} …: {(result.stderr or result.stdout).strip()[-2000:]}"
            )
        return result.stdout.strip()

    def attempt(self, *arguments: str, timeout_s: float = COMMAND_S) -> subprocess.CompletedProcess[str]:
        """The same, whatever its exit status."""
        environment = os.environ | self.environment
        return subprocess.run(
            [self.program, *arguments], env=environment, capture_output=True, text=True, timeout=timeout_s, check=False
        )

    def build(self, *arguments: str, log: Path, timeout_s: float = 3600.0) -> None:
        """Builds an image; what it prints goes to a file.

        Raises:
          SmokeError: it failed.
        """
        with log.open("w") as output:
            status = subprocess.call(
                [self.program, "build", *self.build_flags, *arguments],
                env=os.environ | self.environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                timeout=timeout_s,
            )
        if status != 0:
            raise SmokeError(f"the image does not build with {self.name}; the end of its log:\n{_tail(log)}")


def engines(folder: Path, wanted: str | None) -> Iterator[Engine]:
    """The engines that look as if they could work here, the best first.

    Args:
      folder: for the files of those that would otherwise use places of the machine's.
      wanted: the name of the only one to consider; None for all.
    """
    for name, find in (("docker", _docker), ("podman", _podman), ("chroot", _chroot)):
        if wanted in (None, name):
            engine = find(folder)
            if engine is not None:
                yield engine


def _docker(folder: Path) -> Engine | None:
    engine = Engine("docker", "docker", {"DOCKER_BUILDKIT": "1"})
    return engine if _answers(engine, "version", "--format", "{{.Server.Version}}") else None


def _podman(folder: Path) -> Engine | None:
    """Podman; for root with its own storage and network, which needs neither systemd nor bridges."""
    engine = Engine("podman", "podman", build_flags=("--format", "docker"))
    if shutil.which("podman") is None:
        return None
    if os.geteuid() != 0:
        return engine if _answers(engine, "info") else None
    own_mounts()
    # As high as anyone may set them: podman's defaults take a privilege that a root in a sandbox can lack.
    limits = {name: min(resource.getrlimit(number)[1], wanted) for name, number, wanted in _LIMITS}
    ulimits = ", ".join(f'"{name}={limit}:{limit}"' for name, limit in limits.items())
    configuration = folder / "containers.conf"
    configuration.write_text(
        f'[containers]\nnetns = "host"\ndefault_ulimits = [{ulimits}]\n'
        '[engine]\ncgroup_manager = "cgroupfs"\nevents_logger = "file"\n'
    )
    environment = _storage(folder) | {"CONTAINERS_CONF": str(configuration)}
    flags = ("--format", "docker", "--layers=false", "--isolation", "chroot")
    return Engine("podman", "podman", environment, flags, private=True)


def _chroot(folder: Path) -> Engine | None:
    if shutil.which("buildah") is None or os.geteuid() != 0:
        return None
    own_mounts()
    environment = _storage(folder) | {"CHROOT_ENGINE_STATE": str(folder / "chroot-engine")}
    return Engine(
        "buildah chroot", str(HERE / "smoke_test" / "chroot_engine.py"), environment, private=True, read_only=False
    )


def _storage(folder: Path) -> dict[str, str]:
    configuration = folder / "storage.conf"
    configuration.write_text(
        f'[storage]\ndriver = "overlay"\ngraphroot = "{folder}/storage"\nrunroot = "{folder}/run"\n'
    )
    return {"CONTAINERS_STORAGE_CONF": str(configuration)}


def _answers(engine: Engine, *arguments: str) -> bool:
    if shutil.which(engine.program) is None:
        return False
    try:
        return engine.attempt(*arguments, timeout_s=60).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def _tail(log: Path) -> str:
    return "\n".join(log.read_text(errors="replace").splitlines()[-30:])


_LIMITS = (("nofile", resource.RLIMIT_NOFILE, 16384), ("nproc", resource.RLIMIT_NPROC, 8192))


def no_engine(wanted: str | None, tried: Sequence[str]) -> NoEngineError:
    """What to say where none of them works."""
    among = wanted or "docker, podman, buildah"
    found = "; ".join(tried) or "none of them answers"
    return NoEngineError(
        f"wanted an engine of {among}; {found}. Debian has the packages podman, buildah and debootstrap"
    )
