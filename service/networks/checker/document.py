"""Reading one XML document without believing it: bounded, allow-listed, and written anew.

The simulator never sees what the user sent, only what `Document.text` says: the elements and attributes that were
read and found harmless. So it does not matter where its parser would have read the same bytes differently.
"""

import re
from collections.abc import Mapping
from typing import Protocol
from xml.etree.ElementTree import ParseError
from xml.sax.saxutils import escape

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from service.errors import UploadError
from service.networks.checker.vocabulary import DOCUMENT, VOCABULARIES, Element
from service.networks.limits import MAX_ATTRIBUTES, MAX_DEPTH, MAX_ELEMENTS, MAX_VALUE

Attributes = Mapping[str, str]
_SCHEMA = "{http://www.w3.org/2001/XMLSchema-instance}"  # its attributes say where a schema lies; nobody looks
_ENCODINGS = ("utf-8", "us-ascii", "ascii")
_MARKUP = re.compile('[&<>"]')
_SHOWN = 60


class Observer(Protocol):
    """Told about each element once it is found harmless."""

    def element(self, tag: str, attributes: Attributes, parent: str) -> None:
        """One more element begins.

        Raises:
          UploadError: it contradicts an earlier one.
        """


class Document:
    """The target that the parser tells what it finds."""

    def __init__(self, kind: str, observer: Observer, before: int) -> None:
        self.elements = 0
        self._vocabulary = VOCABULARIES[kind]
        self._before = before
        self._observer = observer
        self._path = [DOCUMENT]
        self._parts: list[str] = ['<?xml version="1.0" encoding="UTF-8"?>\n']

    @property
    def text(self) -> str:
        """The document, written anew."""
        return "".join(self._parts)

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Checks an element as it begins, and writes it."""
        self.elements += 1
        if self._before + self.elements > MAX_ELEMENTS:
            raise UploadError(f"there are more than {MAX_ELEMENTS} elements; wanted at most that")
        parent = self._path[-1]
        if len(self._path) > MAX_DEPTH:
            raise UploadError(f"elements are nested more than {MAX_DEPTH} deep; wanted at most that")
        element = self._vocabulary.get(tag)
        if element is None or parent not in element.inside:
            raise UploadError(f"got <{tag[:_SHOWN]}> in <{parent}>; wanted {self._wanted_in(parent)}")
        kept = {name: value for name, value in attributes.items() if not name.startswith(_SCHEMA)}
        _check(tag, element, kept)
        self._observer.element(tag, kept, parent)
        self._parts.append(_opening(tag, kept))
        self._path.append(tag)

    def end(self, tag: str) -> None:
        """An element ends."""
        self._path.pop()
        self._parts.append(f"</{tag}>\n")

    def data(self, text: str) -> None:
        """Characters between elements; there is nothing to say there."""
        if not text.isspace():
            raise UploadError(f"got the text {text.strip()[:_SHOWN]!r} between elements; wanted none")

    def close(self) -> None:
        """The document ends."""

    def _wanted_in(self, parent: str) -> str:
        fitting = sorted(tag for tag, element in self._vocabulary.items() if parent in element.inside)
        names = ", ".join(f"<{tag}>" for tag in fitting) or "no element"
        return f"{names}. Nothing that names a file or writes output is taken"


class _Root:
    """A target that only wants to know how the document begins."""

    tag = ""

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self.tag = tag
        raise StopIteration

    def end(self, tag: str) -> None: ...

    def close(self) -> None: ...


def root_of(data: bytes) -> str:
    """Returns the name of a document's root element."""
    root = _Root()
    try:
        parse(data, root)
    except StopIteration:
        return root.tag
    raise UploadError("there is no element; wanted a network")


def read(data: bytes, kind: str, observer: Observer, before: int = 0) -> Document:
    """Reads a document of a kind of root; `before` elements were read in earlier ones, and count for the limit."""
    document = Document(kind, observer, before)
    parse(data, document)
    return document


def parse(data: bytes, target: object) -> None:
    """Feeds a document to a target of `XMLParser`; an UploadError has the line."""
    _check_encoding(data)
    parser = DefusedXMLParser(target=target, forbid_dtd=True)
    parser.parser.XmlDeclHandler = _check_declaration
    try:
        parser.feed(data)  # at once: expat would scan an unfinished token again with every piece
        parser.close()
    except UploadError as error:
        raise UploadError(f"line {parser.parser.CurrentLineNumber}: {error}") from error
    except DefusedXmlException as error:
        raise UploadError(
            f"line {parser.parser.CurrentLineNumber}: got a DOCTYPE; wanted a document without"
        ) from error
    except ParseError as error:
        raise UploadError(f"it is no well-formed XML: {error}") from error


def _check_encoding(data: bytes) -> None:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise UploadError(f"byte {error.start} is no UTF-8 ({error.reason}); wanted a file saved as UTF-8") from error
    if b"\0" in data:  # by which the parser would tell UTF-16
        raise UploadError(f"byte {data.index(0)} is NUL; wanted a file saved as UTF-8")


def _check_declaration(version: str, encoding: str | None, standalone: int) -> None:
    if version != "1.0":
        raise UploadError(f"the document is XML {version[:_SHOWN]}; wanted 1.0")
    if encoding is not None and encoding.lower() not in _ENCODINGS:
        raise UploadError(f"the document declares the encoding {encoding[:_SHOWN]!r}; wanted UTF-8")


def _check(tag: str, element: Element, attributes: Attributes) -> None:
    if len(attributes) > MAX_ATTRIBUTES:
        raise UploadError(f"<{tag}> has {len(attributes)} attributes; wanted at most {MAX_ATTRIBUTES}")
    for name, value in attributes.items():
        type_ = element.attributes.get(name)
        if type_ is None:
            known = ", ".join(element.attributes) or "none"
            raise UploadError(
                f"<{tag}> has the attribute {name[:_SHOWN]!r}; wanted one of {known}. "
                "Nothing that names a file or writes output is taken"
            )
        if len(value) > MAX_VALUE:
            raise UploadError(f"{name} of <{tag}> has {len(value)} characters; wanted at most {MAX_VALUE}")
        if not type_.holds(value):
            raise UploadError(f"{name} of <{tag}> is {value[:_SHOWN]!r}; wanted {type_.wanted}")
    missing = element.required - attributes.keys()
    if missing:
        raise UploadError(f"<{tag}> has no {', '.join(sorted(missing))}; wanted one")


def _opening(tag: str, attributes: Attributes) -> str:
    written = "".join(f' {name}="{_escaped(value)}"' for name, value in attributes.items())
    return f"<{tag}{written}>"


def _escaped(value: str) -> str:
    return escape(value, {'"': "&quot;"}) if _MARKUP.search(value) else value
