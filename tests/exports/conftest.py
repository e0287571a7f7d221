"""One exported failure of each family, and the readers of other projects."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from risk_sac.failures.bundle import read_bundle
from risk_sac.failures.export.formats import FORMATS, FormatName, export, write
from risk_sac.failures.export.recorded import Recorded
from tests.exports.make_examples import FOLDER, played_here
from tests.overlaps import overlaps_in
from tests.server import ROOT

CM = 0.01  # that a round trip may move anything, m
# The checkers pin versions that are none of ours, so that they have an environment of their own: `make checkers`.
CHECKERS = Path(os.environ.get("RISK_SAC_CHECKERS", ROOT / ".venv" / "checkers")) / "bin"
checked = pytest.mark.skipif(not CHECKERS.exists(), reason="no checkers")


@pytest.fixture(scope="session")
def failure() -> Callable[[str], Recorded]:
    """The example of a family as this processor plays it."""
    played: dict[str, Recorded] = {}

    def of(family: str) -> Recorded:
        if family not in played:
            bundle = played_here(read_bundle(FOLDER / f"{family}.npz"))
            assert overlaps_in(bundle.series) == []
            played[family] = Recorded.of(bundle)
        return played[family]

    return of


@pytest.fixture(scope="session")
def exported(failure: Callable[[str], Recorded], tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Exports a family's failure in a format: the file, or a folder."""
    folder = tmp_path_factory.mktemp("exports")

    def of(family: str, name: FormatName) -> Path:
        out = folder / f"{family}-{name}{'' if FORMATS[name].suffix == '.zip' else FORMATS[name].suffix}"
        if not out.exists():
            write(FORMATS[name], export(name, failure(family)), out)
        return out

    return of


def ask_checkers(program: str, *arguments: str | Path) -> str:
    """What a program of this folder prints in the checkers' environment."""
    command = [CHECKERS / "python", Path(__file__).with_name(program), *arguments]
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(command, capture_output=True, text=True, env=clean)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout
