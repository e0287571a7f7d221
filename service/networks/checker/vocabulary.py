"""The elements and attributes that an upload may use, for each kind of file, as `vocabulary.toml` lists them."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.networks.checker import values
from service.networks.checker.values import Type

DOCUMENT = "document"  # what a root element stands in


@dataclass(frozen=True, slots=True)
class Element:
    """Where an element may stand and what it may say."""

    inside: frozenset[str]
    attributes: Mapping[str, Type]
    required: frozenset[str]


def _typed(names: Mapping[str, str]) -> dict[str, Type]:
    return {name: getattr(values, type_.upper()) for type_, text in names.items() for name in text.split()}


_LISTED = tomllib.loads(Path(__file__).with_name("vocabulary.toml").read_text("utf-8"))
_USUAL = _typed(_LISTED["usual"])


def _element(root: str, listed: Mapping[str, Any]) -> Element:
    must = listed.get("must", "").split()
    may = " ".join(_LISTED["groups"].get(name, name) for name in listed.get("may", "").split()).split()
    attributes = {name: _USUAL.get(name, values.WORD) for name in (*may, *must)} | _typed(listed.get("as", {}))
    return Element(frozenset(_named(root, tag) for tag in listed["inside"].split()), attributes, frozenset(must))


def _named(root: str, tag: str) -> str:
    return root if tag == "root" else tag


def _vocabulary(root: str, *sections: str) -> Mapping[str, Element]:
    elements = {tag: listed for section in sections for tag, listed in _LISTED[section].items()}
    return {_named(root, tag): _element(root, listed) for tag, listed in elements.items()}


VOCABULARIES = {
    "net": _vocabulary("net", "net", "signals"),
    "routes": _vocabulary("routes", "demand"),
    "additional": _vocabulary("additional", "demand", "signals", "additional"),
}
