"""What is this process's own, and goes with it: what is mounted, what listens, and who was started."""

import contextlib
import ctypes
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

CLONE_NEWNS = 0x00020000
CLONE_NEWNET = 0x40000000
PR_SET_CHILD_SUBREAPER = 36
# crun knows version 1 and version 2 of cgroups, but not both at once.
HYBRID_CGROUPS = Path("/sys/fs/cgroup/unified")
BUSY_S = 20.0
SWITCH = "switch"


def own_mounts() -> None:
    """From here on, mounts are this process's and its children's alone."""
    _unshare(CLONE_NEWNS)
    subprocess.run(["mount", "--make-rprivate", "/"], check=True)
    if HYBRID_CGROUPS.is_mount():
        subprocess.run(["umount", HYBRID_CGROUPS], check=True)


def own_network() -> None:
    """From here on there is a loopback device, and nothing else: no port is taken, none is open to others."""
    _unshare(CLONE_NEWNET)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)


class Hosts:
    """Machines of a network of their own: namespaces of this one, with the same files and processes."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = {name: f"risk-sac-{os.getpid()}-{name}" for name in (SWITCH, *names)}
        self.addresses = {name: f"10.213.0.{number}" for number, name in enumerate(names, start=1)}

    def __enter__(self) -> "Hosts":
        with contextlib.ExitStack() as undone:
            undone.callback(self._delete)
            for name in self._names.values():
                _ip("netns", "add", name)
            switch = self._names[SWITCH]
            _ip("-n", switch, "link", "add", "switch", "type", "bridge")
            _ip("-n", switch, "link", "set", "switch", "up")
            for name, address in self.addresses.items():
                host, port = self._names[name], f"to-{address.rpartition('.')[2]}"
                _ip("-n", host, "link", "add", "eth0", "type", "veth", "peer", "name", port, "netns", switch)
                _ip("-n", switch, "link", "set", port, "master", "switch", "up")
                _ip("-n", host, "address", "add", f"{address}/24", "dev", "eth0")
                for device in ("lo", "eth0"):
                    _ip("-n", host, "link", "set", device, "up")
            undone.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._delete()

    def on(self, name: str) -> list[str]:
        """What has to stand before a command that is to be executed on a host."""
        return ["ip", "netns", "exec", self._names[name]]

    def processes(self, name: str) -> list[int]:
        """Of a host."""
        return [int(pid) for pid in _ip("netns", "pids", self._names[name]).split()]

    @contextlib.contextmanager
    def visited(self, name: str) -> Iterator[None]:
        """While this lasts, the calling thread is on that host's network."""
        own = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
        there = os.open(f"/run/netns/{self._names[name]}", os.O_RDONLY)
        try:
            _set_namespace(there)
            yield
        finally:
            _set_namespace(own)
            os.close(own)
            os.close(there)

    def _delete(self) -> None:
        for name in self._names.values():
            subprocess.run(["ip", "netns", "delete", name], capture_output=True, check=False)


def _ip(*arguments: str) -> str:
    return subprocess.run(["ip", *arguments], capture_output=True, text=True, check=True).stdout


def own_processes() -> None:
    """From here on, what its children leave behind when they end becomes this process's child, not the machine's."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)


def end_processes() -> None:
    """Kills the children, and what they leave behind, until there is none."""
    while children := Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        for child in map(int, children):
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def delete(folder: Path) -> None:
    """Deletes a folder with what is mounted in it, again while an engine's own cleaning up has it busy."""
    end = time.monotonic() + BUSY_S
    while True:
        points = [line.split()[4] for line in Path("/proc/self/mountinfo").read_text().splitlines()]
        for point in sorted((each for each in points if Path(each).is_relative_to(folder)), reverse=True):
            subprocess.run(["umount", "--lazy", point], check=False)
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists() or time.monotonic() > end:
            return
        time.sleep(0.5)


def _unshare(kind: int) -> None:
    """`os.unshare` of Python 3.12."""
    _called("unshare", kind)


def _set_namespace(descriptor: int) -> None:
    """`os.setns` of Python 3.12."""
    _called("setns", descriptor, CLONE_NEWNET)


def _called(function: str, *arguments: int) -> None:
    if getattr(ctypes.CDLL(None, use_errno=True), function)(*arguments) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
