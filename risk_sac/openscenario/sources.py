"""Finds and reads the files of a scenario: its roads, catalogs and variation."""

import io
import re
import stat
import zipfile
from pathlib import Path

from risk_sac.errors import ConfigError
from risk_sac.openscenario.elements import MAX_BYTES, XmlElement, parse, plain

MAX_FILES = 200
ROOT = "OpenSCENARIO"
VERSIONS = ("1.0", "1.1", "1.2", "1.3")


class SourceFiles:
    """Files of one import."""

    def __init__(self, within: Path | None = None) -> None:
        """Prepares to read.

        Args:
          within: the folder that no file may lie outside of; None: any that the user may read.
        """
        self._within = within.resolve() if within is not None else None
        self._roots: dict[Path, XmlElement] = {}  # of files that were read
        self._count = 0

    def find(self, name: str, beside: Path, place: XmlElement) -> Path:
        """Returns the path of a file or folder that an element names.

        Args:
          name: as the element has it, with either kind of slash.
          beside: the file that the element is in.
          place: the element.

        Raises:
          ConfigError: it is not there, or outside the upload.
        """
        if not name or "\0" in name or len(name) > 1000:
            raise place.refusal(f"the file name {name[:80]!r}", "a path relative to this file")
        path = (beside.parent / name.replace("\\", "/").removeprefix("file://")).resolve()
        if self._within is not None and not path.is_relative_to(self._within):
            raise place.refusal(f"{name!r}, which is outside the upload", "a path inside it", "put the file into it")
        try:
            there = path.exists()
        except OSError:
            there = False
        if not there:
            raise place.refusal(f"{name!r}, which is not there", "a file", "check the path, or add the file")
        return path

    def content(self, path: Path, place: str) -> bytes:
        """Reads a file; raises `ConfigError` with the place that names it."""
        self._count += 1
        if self._count > MAX_FILES:
            raise ConfigError(place, f"more than {MAX_FILES} files", "fewer", "leave out catalogs that are not used")
        try:
            if not path.is_file():
                raise ConfigError(place, f"{path.name!r}, which is no plain file", "a file")
            if (size := path.stat().st_size) > MAX_BYTES:
                raise ConfigError(place, f"{path.name!r} of {size} bytes", f"at most {MAX_BYTES}")
            return path.read_bytes()
        except OSError as error:
            raise ConfigError(place, f"{path.name!r}, which cannot be read ({error.strerror})", "a file") from error

    @property
    def roots(self) -> list[XmlElement]:
        """Root elements of all OpenSCENARIO files that were read."""
        return list(self._roots.values())

    def root(self, path: Path, place: str) -> XmlElement:
        """Reads an OpenSCENARIO file, once; raises `ConfigError` for another root or an unknown version."""
        if path not in self._roots:
            root = parse(self.content(path, place), plain(path.name))
            if root.tag != ROOT:
                remedy = "OpenSCENARIO 2 (.osc) and 0.9 are other languages" if root.tag != "OpenDRIVE" else ""
                raise root.refusal(f"the root <{root.tag[:80]}>", f"<{ROOT}>", remedy)
            root.used = True
            _check_version(root)
            self._roots[path] = root
        return self._roots[path]


def version(root: XmlElement) -> str:
    """The version that a file states, such as `1.3`."""
    header = next(iter(root.all("FileHeader")), None)
    return f"{header.attribute('revMajor')}.{header.attribute('revMinor')}" if header else "none"


def _check_version(root: XmlElement) -> None:
    if (stated := version(root)) not in VERSIONS:
        header = next(iter(root.all("FileHeader")), root)
        raise header.refusal(f"version {stated[:20]}", f"one of {', '.join(VERSIONS)}", "convert the file")


MOST_UNPACKED = 100 << 20  # of all files, once unpacked
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
    """Unpacks an archive's scenario files into a folder; returns the file to import.

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
    left = MOST_UNPACKED
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
                    raise ConfigError("archive", f"more than {MOST_UNPACKED >> 20} MiB once unpacked", "less")
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
