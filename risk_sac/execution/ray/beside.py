"""What a worker reads beside its run's folder, and how it finds it on its node."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from risk_sac.config import SHIPPED, RunSpec
from risk_sac.egos import registry
from risk_sac.scenario import library

EGOS, PLACES = "egos.toml", "places"


@dataclass(frozen=True, slots=True)
class Beside:
    """Files that travel with an attempt."""

    files: dict[str, str]  # paths on the server's machine, of files and folders, by their place on the node
    environment: dict[str, str]  # by which a worker finds those that its arguments do not name


def beside(spec: RunSpec, inputs: Sequence[Path], folder: Path) -> Beside:
    """What an attempt at a run takes along: the egos that the server's operator has registered, and the run's place.

    Args:
      spec: the run.
      inputs: files that its arguments name.
      folder: of the node, where all of it will lie.
    """
    files = {path.name: path for path in inputs}
    environment = {registry.FILE: ""}  # whatever a node registers by itself does not count
    if registered := os.environ.get(registry.FILE):
        files[EGOS] = Path(registered)
        environment[registry.FILE] = str(folder / EGOS)
    if spec.family not in SHIPPED:
        files[f"{PLACES}/{spec.family}"] = library.library() / spec.family
        environment[library.VARIABLE] = str(folder / PLACES)
    return Beside({name: str(path.resolve()) for name, path in files.items()}, environment)
