"""`python -m tests.exports.make_examples`: writes an example per format, and test bundles.

The bundles say what is played; the episodes are those of a short search. `risk_sac/scenario/README.md`
shows the pictures of the families.
"""

import subprocess
import sys
import tempfile
from contextlib import closing
from pathlib import Path

from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import SimulationError
from risk_sac.failures.bundle import Bundle, make_bundle, read_bundle, write_bundle
from risk_sac.failures.export.formats import FORMATS, FormatName, export, names, write
from risk_sac.failures.export.recorded import Recorded
from risk_sac.failures.net import roads_of, thumbnail
from risk_sac.failures.play import replay
from risk_sac.failures.recording import Recording
from risk_sac.run_folder.results import RecordedFailure

FOLDER = Path(__file__).with_name("examples")
FAMILIES = ("low", "mixed", "dense")
SHOWN = "low"  # family of the examples
SEARCH = ("--scenario", "mixed", "--method", "archive", "--episodes", "60", "--seed", "601")


def played_here(bundle: Bundle) -> Bundle:
    """Plays a bundle; same code and processor give the same result."""
    manifest = bundle.manifest
    with closing(RiskSacEnv.of(manifest.spec)) as env:
        played = replay(env, manifest.episode, bundle.series)
    episode = played.record(manifest.episode)
    if not episode.valid_violations:
        raise SimulationError(f"{manifest.id} is no failure here any more; wanted another example")
    return make_bundle(manifest.spec, episode, played.series, played.signal_heads, bundle.policy)


def picture(bundle: Bundle) -> str:
    """Returns the failure of a bundle as an SVG."""
    manifest = bundle.manifest
    recording = Recording(RecordedFailure.of(manifest.spec.id, manifest.episode), bundle.series)
    return thumbnail(recording, roads_of(manifest.spec.family, manifest.episode.scene))


def example(name: FormatName) -> Path:
    """Returns the file of a format's example."""
    suffix = FORMATS[name].suffix
    stem = "episodes" if FORMATS[name].of == "episodes" else SHOWN
    return FOLDER / (f"{stem}-{name}.zip" if suffix == ".zip" else f"{stem}{suffix}")


def main() -> None:
    """Writes all of them."""
    for family in FAMILIES:
        bundle = FOLDER / f"{family}.npz"
        write_bundle(bundle, played_here(read_bundle(bundle)))
        (FOLDER / f"{family}.svg").write_text(picture(read_bundle(bundle)))
    failure = Recorded.of(read_bundle(FOLDER / f"{SHOWN}.npz"))
    for name in names("failure"):
        write(FORMATS[name], export(name, failure), example(name))
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "risk_sac", "run", *SEARCH, "--out", folder], check=True)
        for name in names("episodes"):
            write(FORMATS[name], export(name, [Path(folder)]), example(name))


if __name__ == "__main__":
    main()
