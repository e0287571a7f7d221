"""`python -m risk_sac.failures.export.examples`: the examples anew, one failure of each family in all formats.

The bundles that lie beside the exports say what is played; the episodes are those of a short search.
"""

import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

from risk_sac.env import RiskSacEnv
from risk_sac.errors import SimulationError
from risk_sac.failures.bundle import Bundle, make_bundle, read_bundle, write_bundle
from risk_sac.failures.export.formats import FORMATS, Files, FormatName, names, of_episodes, of_failure
from risk_sac.failures.export.recorded import Recorded
from risk_sac.failures.export.written import write
from risk_sac.failures.play import play
from risk_sac.failures.trajectory import actions_of
from risk_sac.types import Scene

FOLDER = Path(__file__).with_name("examples")
SEARCH = ("--family", "mixed", "--method", "archive", "--episodes", "60", "--seed", "601")


def bundles() -> list[Path]:
    """One of each family."""
    return sorted(FOLDER.glob("*.npz"))


def played_here(bundle: Bundle) -> Bundle:
    """What the scene and the actions of a bundle come to here: with the same code and kind of processor, the same."""
    manifest = bundle.manifest
    with closing(RiskSacEnv.of(manifest.spec)) as env:
        scene = Scene(manifest.spec.family, manifest.episode.scene)
        played = play(env, scene, manifest.episode.seed, actions_of(bundle.series))
    if played.collision is None:
        raise SimulationError(f"{manifest.id} is no failure here any more; wanted another example")
    episode = manifest.episode.model_copy(update={"collision": played.collision})
    return make_bundle(manifest.spec, episode, played.series, played.signal_heads, bundle.policy)


def place(stem: str, name: FormatName) -> Path:
    """Where an example is."""
    suffix = FORMATS[name].suffix
    return FOLDER / (f"{stem}-{name}.zip" if suffix == ".zip" else f"{stem}{suffix}")


def _main() -> None:
    for bundle in bundles():
        played = played_here(read_bundle(bundle))
        write_bundle(bundle, played)
        failure = Recorded.of(played)
        for name in names("failure"):
            _write(name, of_failure(name, failure), place(bundle.stem, name))
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "risk_sac", "run", *SEARCH, "--out", folder], check=True)
        for name in names("episodes"):
            _write(name, of_episodes(name, [Path(folder)]), place("episodes", name))


def _write(name: FormatName, files: Files, out: Path) -> None:
    write(FORMATS[name], files, out)
    print(f"{out.name}: {out.stat().st_size} bytes")  # noqa: T201 - to whoever started it


if __name__ == "__main__":
    _main()
