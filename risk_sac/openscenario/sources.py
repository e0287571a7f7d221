"""Reads a scenario's files as XML elements that know their line.

An element also knows whether it was used.

Document types, and so entities, are refused; nothing outside the files is opened.
"""

import io
import re
import stat
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, get_args
from xml.parsers.expat import ExpatError, ParserCreate

from pydantic import ValidationError

from risk_sac.config.base import Settings, field_error
from risk_sac.errors import ConfigError

MAX_BYTES = 20 << 20  # of one file
MAX_ELEMENTS = 500_000
MAX_DEPTH = 60
MAX_ATTRIBUTES = 50  # of one element
MAX_VALUE = 5_000  # characters of one attribute
_SHOWN = 80

Built = TypeVar("Built", bound=Settings)


class Unread(ConfigError):
    """A valid but unread part; `effect` is the consequence for an episode."""

    def __init__(self, field: str, got: str, expected: str, effect: str) -> None:
        super().__init__(field, got, expected)
        self.args = field, got, expected, effect
        self.effect = effect


@dataclass(slots=True, eq=False)
class XmlElement:
    """Element of a file."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    children: list["XmlElement"] = field(default_factory=list)
    used: bool = False
    used_attributes: set[str] = field(default_factory=set)

    @property
    def place(self) -> str:
        """File, line and name, as messages give them."""
        return plain(f"{self.file}, line {self.line}, <{self.tag[:_SHOWN]}>")

    def refusal(self, got: str, expected: str = "", remedy: str = "") -> ConfigError:
        """Returns the error of something that is wrong here."""
        return ConfigError(self.place, plain(got[: _SHOWN * 4]), plain(expected), plain(remedy))

    def unread(self, expected: str, effect: str) -> Unread:
        """Returns the error of something here that is valid but not read."""
        return Unread(self.place, "what is not read", expected, effect)

    def attribute(self, name: str) -> str | None:
        """Returns an attribute, and notes its use."""
        self.used_attributes.add(name)
        return self.attributes.get(name)

    def all(self, *tags: str) -> list["XmlElement"]:
        """Returns the children of some names, and notes their use."""
        children = [child for child in self.children if child.tag in tags]
        for child in children:
            child.used = True
        return children

    def use_all(self) -> None:
        """Notes the use of everything below."""
        self.used = True
        self.used_attributes |= self.attributes.keys()
        for child in self.children:
            child.use_all()

    def build(self, model: type[Built], **fields: Any) -> Built:
        """Builds a model, with its only kind; raises `ConfigError` with this place."""
        kinds = get_args(model.model_fields["kind"].annotation) if "kind" in model.model_fields else ()
        if len(kinds) == 1:
            fields["kind"] = kinds[0]
        try:
            return model(**fields)
        except ValidationError as error:
            fault = field_error(error.errors()[0], model)
            got = f"{fault.field}: {fault.got}".removeprefix(": ")
            raise self.refusal(got, fault.expected, fault.remedy) from error

    def below(self) -> Iterator["XmlElement"]:
        """Yields this element and all below."""
        yield self
        for child in self.children:
            yield from child.below()


def plain(text: str) -> str:
    """Replaces unprintable characters, such as those that reverse the direction, by "?"."""
    return text if text.isprintable() else "".join(char if char.isprintable() else "?" for char in text)


def parse(content: bytes, file: str) -> XmlElement:
    """Reads the elements of a file.

    Raises:
      ConfigError: it is no well-formed XML, has a document type, or is beyond a limit.
    """
    if len(content) > MAX_BYTES:
        raise ConfigError(file, f"{len(content)} bytes", f"at most {MAX_BYTES}")
    tree = _Tree(file)
    try:
        tree.parser.Parse(content, True)
    except ConfigError:
        raise
    except (ExpatError, LookupError, ValueError) as error:  # the latter two: an encoding that Python lacks
        raise ConfigError(file, f"no well-formed XML: {error}", "an XML file") from error
    if tree.root is None:
        raise ConfigError(file, "no element", "an XML file")
    return tree.root


class _Tree:
    """Handlers of a parser that build elements."""

    def __init__(self, file: str) -> None:
        self.root: XmlElement | None = None
        self._file, self._open, self._count = file, list[XmlElement](), 0
        self.parser = ParserCreate()
        self.parser.StartElementHandler, self.parser.EndElementHandler = self._start, self._end
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        element = XmlElement(tag, attributes, self._file, self.parser.CurrentLineNumber)
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise element.refusal(f"more than {MAX_ELEMENTS} elements", "at most that")
        if len(self._open) >= MAX_DEPTH:
            raise element.refusal(f"elements nested more than {MAX_DEPTH} deep", "at most that")
        if len(attributes) > MAX_ATTRIBUTES:
            raise element.refusal(f"{len(attributes)} attributes", f"at most {MAX_ATTRIBUTES}")
        for name, value in attributes.items():
            if len(value) > MAX_VALUE:
                raise element.refusal(f"{len(value)} characters in {name[:_SHOWN]!r}", f"at most {MAX_VALUE}")
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def _end(self, _tag: str) -> None:
        self._open.pop()

    def _doctype(self, *_: object) -> None:
        where = f"{self._file}, line {self.parser.CurrentLineNumber}"
        raise ConfigError(where, "a DOCTYPE", "a document without", "remove it; entities are not read")


MAX_FILES = 200
ROOT = "OpenSCENARIO"
VERSIONS = ("1.0", "1.1", "1.2", "1.3")


class SourceFiles:
    """Files of one import."""

    def __init__(self, within: Path | None = None) -> None:
        """Prepares to read files within a folder, and none outside.

        With None it reads any that the user may read.
        """
        self._within = within.resolve() if within is not None else None
        self._roots: dict[Path, XmlElement] = {}  # of files that were read
        self._count = 0

    def find(self, name: str, beside: Path, place: XmlElement) -> Path:
        """Returns the path of a file or folder that an element names.

        It is relative to the element's file, and has either kind of slash.

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
        """Reads an OpenSCENARIO file once; raises `ConfigError` for another root or version."""
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
    """Unpacks an archive's scenario files into a folder; returns the main file.

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
