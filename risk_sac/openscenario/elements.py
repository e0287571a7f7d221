"""Reads XML into elements that know their line, and whether they were used.

Document types, and so entities, are refused; nothing outside the file is opened.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar
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
    """Part of a scenario that is valid but not read; `effect` says what that means for an episode."""

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
        """Makes a model of what was read here; raises `ConfigError` with this place."""
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
    """Returns a text without characters that do not print, such as those that turn its direction."""
    return text if text.isprintable() else "".join(char if char.isprintable() else "?" for char in text)


def parse(content: bytes, file: str) -> XmlElement:
    """Reads the elements of a file.

    Args:
      content: the file's bytes.
      file: what messages call it.

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
