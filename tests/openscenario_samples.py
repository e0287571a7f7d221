"""Small OpenSCENARIO files of the tests, and copies of them with changes."""

import shutil
from pathlib import Path

FILES = Path(__file__).parent / "unit" / "openscenario" / "files"
SCENARIO, VARIATION, BODIES, WAYS = "cut_in.xosc", "variation.xosc", "catalogs/bodies.xosc", "catalogs/ways.xosc"


def copied(folder: Path, *changes: tuple[str, str, str]) -> Path:
    """Copies the files into a folder, with changes: file, old, new text."""
    there = folder / "files"
    shutil.copytree(FILES, there)
    for file, old, new in changes:
        text = (there / file).read_text()
        assert old in text, (file, old)
        (there / file).write_text(text.replace(old, new, 1))
    return there
