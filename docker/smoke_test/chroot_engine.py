#!/usr/bin/env python3
"""Docker's command line as far as `workflow.yaml` uses it, where there is no engine: buildah with chroot isolation.

It needs root. A container has its own files, user, capabilities and processes, but shares the caller's network, can
write wherever its user may (`--read-only` is not enforced), and knows no limits. State lies in $CHROOT_ENGINE_STATE.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

GONE_S = 30.0


def _state() -> Path:
    return Path(os.environ["CHROOT_ENGINE_STATE"])


@dataclass
class Container:
    """One container, as its file in the state says."""

    name: str
    working: str
    """Name of buildah's working container."""
    flags: list[str]
    """Of `buildah run`, for the process that it was made for and for those that join it."""
    command: list[str]
    volumes: dict[str, str]
    """Folders of the host by their place in the container."""
    process: int = 0
    """The process that holds all others, 0 before the first start."""

    @classmethod
    def load(cls, name: str) -> "Container":
        """The container of this name."""
        file = _state() / "containers" / f"{name}.json"
        if not file.is_file():
            raise SystemExit(f"there is no container {name!r}")
        return cls(**json.loads(file.read_text()))

    def save(self) -> None:
        """Keeps what the next command has to know."""
        self.file.parent.mkdir(parents=True, exist_ok=True)
        self.file.write_text(json.dumps(asdict(self)))

    @property
    def file(self) -> Path:
        """Where that is kept."""
        return _state() / "containers" / f"{self.name}.json"

    @property
    def log(self) -> Path:
        """What the first process prints."""
        return self.file.with_suffix(".log")

    def process_command(self, command: list[str], flags: tuple[str, ...] = ()) -> list[str]:
        """All processes of a container are in one namespace, so that they end with the first of them."""
        namespace = ["unshare", "--pid", "--fork", "--kill-child=SIGKILL", "--mount-proc"]
        return [
            *namespace,
            "buildah",
            "run",
            "--isolation",
            "chroot",
            *self.flags,
            *flags,
            self.working,
            "--",
            *command,
        ]

    def start(self) -> None:
        """Runs its command in the background."""
        with self.log.open("ab") as log:
            process = subprocess.Popen(
                self.process_command(self.command),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )
        self.process = process.pid
        self.save()

    def signal(self, number: int) -> None:
        """To the first process of the container itself; SIGKILL to the one that holds all."""
        target = self.process if number == signal.SIGKILL else next(_inside(self.process), self.process)
        if target and _runs(target):
            os.kill(target, number)

    def gone(self, within_s: float) -> bool:
        """Whether its processes end in this time, s."""
        end = time.monotonic() + within_s
        while _runs(self.process):
            if time.monotonic() > end:
                return False
            time.sleep(0.05)
        return True


def _runs(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _inside(process: int) -> Iterator[int]:
    """Descendants that are no part of the machinery around the container, the eldest first."""
    try:
        children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    except OSError:
        return
    for child in map(int, children):
        name = Path(f"/proc/{child}/cmdline").read_text().split("\0")[0]
        if "buildah" not in name and "unshare" not in name:
            yield child
        yield from _inside(child)


def build(options: argparse.Namespace) -> int:
    """Builds an image; the flags are those of `buildah bud`."""
    os.execvp("buildah", ["buildah", "bud", "--isolation", "chroot", "--format", "docker", *options.arguments])


def pull(options: argparse.Namespace) -> int:
    """Gets an image from its registry."""
    return subprocess.call(["buildah", "pull", options.name])


def run(options: argparse.Namespace) -> int:
    """Makes a container and runs its command."""
    container = _create(options)
    if options.detach:
        container.start()
        print(container.name)
        return 0
    try:
        return subprocess.call(container.process_command(container.command))
    finally:
        if options.rm:
            _remove(container)


def _create(options: argparse.Namespace) -> Container:
    config = _config(options.image)
    working = _output("buildah", "from", options.image)
    flags = [
        "--user",
        options.user or config.get("User") or "0",
        "--workingdir",
        options.workdir or config.get("WorkingDir") or "/",
    ]
    flags += [flag for each in options.env for flag in ("--env", each if "=" in each else f"{each}={os.environ[each]}")]
    flags += [flag for each in options.cap_drop for flag in ("--cap-drop", each)]
    flags += [
        flag for each in options.tmpfs for flag in ("--mount", f"type=tmpfs,destination={each.partition(':')[0]}")
    ]
    volumes = {}
    for each in options.volume:
        source, target, *mode = each.split(":")
        folder = source if "/" in source else str(_volume(source, target, working))
        flags += ["--volume", ":".join((folder, target, *mode))]
        volumes[target] = folder
        # Or else what the image declares there would be mounted instead.
        subprocess.run(["buildah", "config", "--volume", f"{target}-", working], check=True)
    command = [options.entrypoint] if options.entrypoint else config.get("Entrypoint") or []
    command += options.arguments or ([] if options.entrypoint else config.get("Cmd") or [])
    container = Container(options.name or f"risk-sac-{uuid.uuid4().hex[:12]}", working, flags, command, volumes)
    container.save()
    return container


def _config(image: str) -> dict[str, Any]:
    config: dict[str, Any] = json.loads(_output("buildah", "inspect", "--type", "image", image))["Docker"]["config"]
    return config


def _volume(name: str, target: str, working: str) -> Path:
    """A named volume's folder; a new one begins with what the image has at its place, owner included."""
    folder = _state() / "volumes" / name
    if not folder.is_dir():
        content = Path(_output("buildah", "mount", working)) / target.lstrip("/")
        folder.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["cp", "--archive", content, folder], check=True)
        subprocess.run(["buildah", "umount", working], check=True, stdout=subprocess.DEVNULL)
    return folder


def execute(options: argparse.Namespace) -> int:
    """Runs one more command beside a container."""
    container = Container.load(options.name)
    flags = tuple(flag for each in options.env for flag in ("--env", each))
    return subprocess.call(container.process_command([options.program, *options.arguments], flags))


def start(options: argparse.Namespace) -> int:
    """Starts a container that has ended."""
    Container.load(options.name).start()
    return 0


def kill(options: argparse.Namespace) -> int:
    """Sends a signal; returns once what got SIGKILL is gone."""
    container = Container.load(options.name)
    container.signal(signal.Signals["SIG" + options.signal.removeprefix("SIG")])
    return 0 if options.signal != "KILL" or container.gone(GONE_S) else 1


def stop(options: argparse.Namespace) -> int:
    """Asks to end, and ends what does not."""
    container = Container.load(options.name)
    container.signal(signal.SIGTERM)
    if not container.gone(options.time):
        container.signal(signal.SIGKILL)
    return 0


def logs(options: argparse.Namespace) -> int:
    """Prints what the container has printed."""
    sys.stdout.write(Container.load(options.name).log.read_text(errors="replace"))
    return 0


def copy(options: argparse.Namespace) -> int:
    """Out of a volume only; that is where a container with a read-only root has its files."""
    name, _, path = options.source.partition(":")
    volumes = Container.load(name).volumes
    target = next((each for each in volumes if Path(path).is_relative_to(each)), None)
    if target is None:
        raise SystemExit(f"{path} is in no volume of {name}")
    source = Path(volumes[target]) / Path(path).relative_to(target)
    return subprocess.call(["cp", "--recursive", source, options.target])


def remove(options: argparse.Namespace) -> int:
    """Ends a container and deletes it."""
    _remove(Container.load(options.name))
    return 0


def _remove(container: Container) -> None:
    if container.process:
        container.signal(signal.SIGKILL)
        container.gone(GONE_S)
    subprocess.run(["buildah", "rm", container.working], check=True, stdout=subprocess.DEVNULL)
    container.file.unlink()
    container.log.unlink(missing_ok=True)


def volume(options: argparse.Namespace) -> int:
    """Deletes a volume; it is made by who uses it first, with what the image has there."""
    if options.verb == "rm":
        shutil.rmtree(_state() / "volumes" / options.name)
    return 0


def _output(*command: str) -> str:
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()


def parser() -> argparse.ArgumentParser:
    """Of the command line."""
    program = argparse.ArgumentParser(description=__doc__)
    commands = program.add_subparsers(required=True)

    def add(name: str, function: Any) -> argparse.ArgumentParser:
        command = commands.add_parser(name, prefix_chars="\0") if name == "build" else commands.add_parser(name)
        command.set_defaults(function=function)
        return command

    add("build", build).add_argument("arguments", nargs=argparse.REMAINDER)
    _add_run(add("run", run))
    for name, function in (("pull", pull), ("start", start), ("logs", logs)):
        add(name, function).add_argument("name")
    execute_ = add("exec", execute)
    execute_.add_argument("--env", action="append", default=[])
    execute_.add_argument("name")
    execute_.add_argument("program")
    execute_.add_argument("arguments", nargs=argparse.REMAINDER)
    kill_ = add("kill", kill)
    kill_.add_argument("--signal", default="KILL")
    kill_.add_argument("name")
    stop_ = add("stop", stop)
    stop_.add_argument("-t", "--time", type=float, default=10)
    stop_.add_argument("name")
    copy_ = add("cp", copy)
    copy_.add_argument("source")
    copy_.add_argument("target")
    remove_ = add("rm", remove)
    remove_.add_argument("--force", action="store_true")
    remove_.add_argument("name")
    volume_ = add("volume", volume)
    volume_.add_argument("verb", choices=("create", "rm"))
    volume_.add_argument("name")
    return program


def _add_run(command: argparse.ArgumentParser) -> None:
    command.add_argument("--rm", action="store_true")
    command.add_argument("--detach", action="store_true")
    for name in ("--name", "--user", "--workdir", "--entrypoint"):
        command.add_argument(name)
    for name in ("--env", "--cap-drop", "--tmpfs", "--volume"):
        command.add_argument(name, action="append", default=[])
    # Taken and not done: see above.
    command.add_argument("--read-only", action="store_true")
    for name in ("--publish", "--network", "--security-opt"):
        command.add_argument(name, action="append")
    command.add_argument("image")
    command.add_argument("arguments", nargs=argparse.REMAINDER)


if __name__ == "__main__":
    options = parser().parse_args()
    sys.exit(options.function(options))
