"""Egos in processes of their own, for tests."""

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import ClassVar

from risk_sac.egos import Control, EpisodeStart, Perceived
from risk_sac.egos.driving import lane_keeping
from risk_sac.world.types import SPEED

CPP = Path(__file__).parents[1] / "risk_sac" / "egos" / "remote" / "cpp"
CPP_COMPILES = all(map(shutil.which, ("make", "g++", "protoc", "grpc_cpp_plugin", "pkg-config")))


@contextmanager
def running(command: Sequence[str], folder: Path, **told: float) -> Iterator[str]:
    """Runs an ego's server; yields the table that registers it, without name."""
    with (
        (folder / "ego.log").open("wb") as log,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as process,
    ):
        try:
            assert process.stdout is not None
            said = process.stdout.readline().split()  # NAME VERSION listens on port PORT
            assert said, (folder / "ego.log").read_text()
            table = {"address": f'"127.0.0.1:{said[-1]}"', "version": f'"{said[1]}"', "response_time_s": 0.8} | told
            yield "".join(f"{name} = {value}\n" for name, value in table.items())
        finally:
            process.kill()


@contextmanager
def served(name: str, folder: Path, **told: float) -> Iterator[str]:
    """A registered Python ego in a process of its own."""
    command = [sys.executable, "-m", "risk_sac.egos.serve", name]
    with running(command, folder, **told) as table:
        yield table


@contextmanager
def served_by_cpp(folder: Path, **told: float) -> Iterator[str]:
    """The example in C++, compiled and at work; only where `CPP_COMPILES`."""
    subprocess.run(["make", f"OUT={folder}"], cwd=CPP, check=True, stdout=subprocess.DEVNULL)
    with running([str(folder / "ego")], folder, **told) as table:
        yield table


class Shadow:
    """Ego that keeps its lane at another driver's speeds and ignores actors."""

    version = "1"
    response_time_s = 1.0

    speeds_mps: ClassVar[Sequence[float]] = ()  # after each step

    def reset(self, episode: EpisodeStart) -> None:
        self._vehicle, self._step_s = episode.vehicle, episode.step_s
        self._next = iter(self.speeds_mps)

    def act(self, perceived: Perceived) -> Control:
        speed = float(perceived.state[SPEED, 0])
        accel = (next(self._next, speed) - speed) / self._step_s
        return Control(accel, lane_keeping(perceived, self._vehicle))

    def close(self) -> None:
        pass


class Noting:
    """Ego that keeps its lane and logs the seed of each episode."""

    version = "1"
    response_time_s = 1.0

    def reset(self, episode: EpisodeStart) -> None:
        self._vehicle = episode.vehicle
        print(episode.seed, file=sys.stderr, flush=True)

    def act(self, perceived: Perceived) -> Control:
        return Control(0.0, lane_keeping(perceived, self._vehicle))

    def close(self) -> None:
        pass


class Slow(Noting):
    """Thinks for 20 ms a step without using a processor."""

    version = "1"
    response_time_s = 1.0

    def act(self, perceived: Perceived) -> Control:
        time.sleep(0.02)
        return super().act(perceived)
