"""Unpacks a zip archive of a scenario with its catalogs and roads, and finds the file to import."""

import io
import re
import stat
import zipfile
from pathlib import Path

from risk_sac.errors import ConfigError
from risk_sac.openscenario.sources import MAX_FILES, SourceFiles

MAX_BYTES = 100 << 20  # of all files, once unpacked
ENDING = ".xosc"
_ENDINGS = (ENDING, ".xodr")
_WANTED = "one variation file, or one scenario, with its catalogs and roads"
_UNSAFE = re.compile(r"^/|\\|^\w:|(^|/)\.\.(/|$)|\0")
_ENCRYPTED = 0x1
_CHUNK = 1 << 16


def holds_scenario(upload: bytes) -> bool:
    """Whether an upload is an archive with an OpenSCENARIO file."""
    try:
        return any(name.lower().endswith(ENDING) for name in zipfile.ZipFile(io.BytesIO(upload)).namelist())
    except (zipfile.BadZipFile, NotImplementedError, ValueError):
        return False


def unpack(upload: bytes, folder: Path) -> Path:
    """Writes the files of an archive into a folder, those of other kinds left out; returns the file to import.

    Raises:
      ConfigError: it is damaged or too large, names files outside it, or has not one file to import.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(upload)) as archive:
            _write(archive, folder)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise ConfigError("archive", f"what cannot be read ({error})", "a zip archive") from error
    return _to_import(folder)


def _write(archive: zipfile.ZipFile, folder: Path) -> None:
    entries = [entry for entry in archive.infolist() if not entry.is_dir()]
    if len(entries) > MAX_FILES:
        raise ConfigError("archive", f"{len(entries)} files", f"at most {MAX_FILES}")
    left = MAX_BYTES
    for entry in entries:
        name = entry.filename
        if _UNSAFE.search(name) or not name.isprintable() or len(name) > 300:
            raise ConfigError("archive", f"an entry named {name[:80]!r}", "a name that stays inside the archive")
        if stat.S_IFMT(entry.external_attr >> 16) not in (0, stat.S_IFREG) or entry.flag_bits & _ENCRYPTED:
            raise ConfigError("archive", f"{name[:80]!r}, which is a link, no file, or encrypted", "plain files")
        if not name.lower().endswith(_ENDINGS):
            continue
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(entry) as source, target.open("wb") as output:
            while chunk := source.read(_CHUNK):
                left -= len(chunk)
                if left < 0:
                    raise ConfigError("archive", f"more than {MAX_BYTES >> 20} MiB once unpacked", "less")
                output.write(chunk)


def _to_import(folder: Path) -> Path:
    sources, variations, scenarios = SourceFiles(folder), list[Path](), list[Path]()
    for file in sorted(path for path in folder.rglob("*") if path.suffix.lower() == ENDING):
        tags = {child.tag for child in sources.root(file, "archive").children}
        if "ParameterValueDistribution" in tags:
            variations.append(file)
        elif "Storyboard" in tags:
            scenarios.append(file)
    candidates = variations or scenarios
    if len(candidates) != 1:
        kind = "variation files" if variations else "scenarios"
        names = ", ".join(str(file.relative_to(folder)) for file in candidates)[:300]
        raise ConfigError("archive", f"{len(candidates)} {kind}{names and f': {names}'}", _WANTED)
    return candidates[0]
