"""Builds the image from what this machine's own pip and apt are set up to use."""

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from smoke_test.engines import HERE, Engine
from smoke_test.errors import SmokeError

IMAGE = "localhost/risk-sac-smoke"
STAND_IN = "localhost/risk-sac-smoke-base"
DEBIAN = "bookworm"
# What `debian:bookworm-slim` leaves out, too.
UNUSED = (
    "usr/share/doc",
    "usr/share/man",
    "usr/share/locale",
    "usr/share/info",
    "var/cache/apt",
    "var/lib/apt/lists",
    "var/log",
)
PULL_S = 300.0


def build(engine: Engine, base: str, folder: Path) -> None:
    """Builds IMAGE.

    Raises:
      SmokeError: it does not build.
    """
    repository = HERE.parent
    revision = subprocess.run(["git", "rev-parse", "HEAD"], cwd=repository, capture_output=True, text=True, check=False)
    arguments = ["--tag", IMAGE, "--file", str(HERE / "Dockerfile"), "--build-arg", f"BASE={base}"]
    arguments += ["--build-arg", f"REVISION={revision.stdout.strip() or 'unknown'}"]
    engine.build(*arguments, *sources(), str(repository), log=folder / "build.log")


def base(engine: Engine, folder: Path) -> str:
    """The Dockerfile's own base where a registry has it, else a Debian of the same release from its packages.

    Raises:
      SmokeError: neither is to be had.
    """
    default = next(
        line.partition("=")[2]
        for line in (HERE / "Dockerfile").read_text().splitlines()
        if line.startswith("ARG BASE=")
    )
    if engine.attempt("pull", default, timeout_s=PULL_S).returncode == 0:
        return default
    if shutil.which("debootstrap") is None or os.geteuid() != 0:
        raise SmokeError(f"no registry has {default} for us, and without root and debootstrap there is no stand-in")
    context = folder / "base"
    if not context.is_dir():
        _debootstrap(context, folder / "debootstrap.log")
    engine.build("--tag", STAND_IN, str(context), log=folder / "base.log")
    return STAND_IN


def sources() -> list[str]:
    """Build flags for the indexes, wheels, certificates and mirrors that this machine itself uses."""
    flags = []
    for name, values in _pip_settings():
        if name in ("index-url", "extra-index-url"):
            urls = [each for each in values if each.startswith("http")]
            if urls:
                flags += ["--build-arg", f"PIP_{name.upper().replace('-', '_')}={' '.join(urls)}"]
        elif name == "find-links":
            folders = [each for each in values if Path(each).is_dir()]
            flags += ["--build-context", f"wheels={folders[0]}"] if folders else []
        elif name == "cert":
            flags += ["--secret", f"id=ca-certificates,src={values[0]}"]
    arguments = {
        "APT_MIRROR": next(iter(_mirror()), "").rstrip("/"),
        "TORCH_INDEX_URL": os.environ.get("TORCH_INDEX_URL"),
        "NPM_CONFIG_REGISTRY": _npm_registry(),
    }
    return flags + [flag for name, value in arguments.items() if value for flag in ("--build-arg", f"{name}={value}")]


def _pip_settings() -> Iterator[tuple[str, list[str]]]:
    listed = subprocess.run(
        [sys.executable, "-m", "pip", "config", "list"], capture_output=True, text=True, check=False
    )
    settings: dict[str, list[str]] = {}
    for line in listed.stdout.splitlines():
        key, separator, value = line.partition("=")
        if separator:
            # The environment, listed first, goes before the files.
            settings.setdefault(key.rpartition(".")[2], str(ast.literal_eval(value)).split())
    yield from settings.items()


def _npm_registry() -> str:
    """Where this machine has npm's packages from; empty where it has no npm."""
    if shutil.which("npm") is None:
        return ""
    command = ["npm", "config", "get", "registry"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def _debootstrap(context: Path, log: Path) -> None:
    root = context / "root"
    context.mkdir()
    with log.open("w") as output:
        command = ["debootstrap", "--variant=minbase", DEBIAN, str(root), *_mirror()]
        if subprocess.call(command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT) != 0:
            raise SmokeError(f"debootstrap failed: {log.read_text()[-1000:]}")
    for folder in UNUSED:
        shutil.rmtree(root / folder)
        (root / folder).mkdir()
    subprocess.run(["tar", "--create", "--file", context / "root.tar", "--directory", root, "."], check=True)
    shutil.rmtree(root)
    (context / "Dockerfile").write_text('FROM scratch\nADD root.tar /\nCMD ["bash"]\n')


def _mirror() -> list[str]:
    """Where this machine has its own Debian packages from, if it is one."""
    targets = subprocess.run(
        [
            "apt-get",
            "indextargets",
            "--format",
            "$(REPO_URI)",
            "Created-By: Packages",
            f"Codename: {DEBIAN}",
            "Label: Debian",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    return targets.stdout.split()[:1]
