"""Egos in processes of their own, for tests."""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from risk_sac.egos import Control, Episode, Perceived
from risk_sac.egos.road import lane_keeping


@contextmanager
def running(command: Sequence[str], folder: Path, **told: float) -> Iterator[str]:
    """An ego's server at work; yields the table with which an operator registers it, without its name."""
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


class LaneKeeper:
    """Keeps its lane and its speed, and looks at nobody."""

    version = "1"
    response_time_s = 1.0

    def reset(self, episode: Episode) -> None:
        self._vehicle = episode.vehicle

    def act(self, perceived: Perceived) -> Control:
        return Control(0.0, lane_keeping(perceived, self._vehicle))

    def close(self) -> None:
        pass
