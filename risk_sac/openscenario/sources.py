"""Finds and reads the files of a scenario: its roads, catalogs and variation."""

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
