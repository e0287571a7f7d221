"""Entries of catalogs, each with the values that its reference assigns to its parameters."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from risk_sac.config.base import Chosen
from risk_sac.openscenario.elements import XmlElement
from risk_sac.openscenario.parameters import TEXTS, read_declaration
from risk_sac.openscenario.scope import At, Meaning, Text
from risk_sac.openscenario.sources import SourceFiles

ENDING = "*.xosc"
MOST_REFERENCES = 5_000  # that an import follows


@dataclass(frozen=True)
class Alternatives:
    """An entry for each word of a parameter."""

    by: str
    of: Mapping[str, At]


class Catalogs:
    """Catalogs that a scenario file gives the folders of."""

    def __init__(self, sources: SourceFiles, file: Path, locations: At | None) -> None:
        """Notes the folders; files are read when an entry is wanted.

        Args:
          sources: reads files.
          file: the scenario file.
          locations: its element `CatalogLocations`.
        """
        self._sources, self._file = sources, file
        self._folders = (
            [folder for kind in locations.element.children for folder in _folders(kind)] if locations else []
        )
        self._catalogs: dict[str, XmlElement] | None = None
        self._references = 0

    def entry(self, reference: At, catalog: str, name: str, *tags: str) -> At:
        """Returns an entry of a catalog with the reference's assignments as its parameters.

        Raises:
          ConfigError: there is no such catalog or entry, it is of another kind, or a value is missing.
        """
        self._references += 1
        if self._references > MOST_REFERENCES:
            raise reference.refusal(f"more than {MOST_REFERENCES} references to catalogs", "fewer")
        catalogs = self._read()
        if catalog not in catalogs:
            raise reference.unknown("the catalog", catalog, catalogs)
        entries = {entry.attributes.get("name", ""): entry for entry in catalogs[catalog].children}
        if name not in entries:
            raise reference.unknown(f"in the catalog {catalog[:80]!r} the entry", name, entries)
        entry = entries[name]
        if entry.tag not in tags:
            raise reference.refusal(f"the entry {name[:80]!r}, a {entry.tag[:80]}", f"a {' or '.join(tags)}")
        catalogs[catalog].used = entry.used = True
        return parametrised(At(entry, reference.scope), assignments(reference))

    def constant_entry(self, reference: At, *tags: str) -> At:
        """Returns the entry that a reference names, if no parameter varies it."""
        return self.entry(reference, reference.constant("catalogName"), reference.constant("entryName"), *tags)

    def alternatives(self, reference: At, *tags: str) -> At | Alternatives:
        """Returns the entry that a reference names, or one for each word of a parameter.

        Raises:
          ConfigError: two parameters choose catalog and entry, and an entry is in several of the catalogs or none.
        """
        catalog, name = reference.text("catalogName"), reference.text("entryName")
        if isinstance(catalog, str) and isinstance(name, str):
            return self.entry(reference, catalog, name, *tags)
        choice = name if isinstance(name, Chosen) else catalog
        assert isinstance(choice, Chosen)
        entries = {}
        for word, text in choice.of.items():
            names = (catalog, text) if isinstance(name, Chosen) else (text, name)
            entries[word] = self.entry(reference, *self._pair(reference, *names), *tags)
        return Alternatives(choice.by, entries)

    def _pair(self, reference: At, catalog: Text, name: Text) -> tuple[str, str]:
        """Returns catalog and entry; of several catalogs the one that has the entry."""
        assert isinstance(name, str)
        if isinstance(catalog, str):
            return catalog, name
        texts = dict.fromkeys(catalog.of.values())
        having = [text for text in texts if name in _names(self._read().get(text))]
        if len(having) != 1:
            got = f"the entry {name[:80]!r} in {len(having)} of the catalogs {', '.join(texts)[:200]}"
            raise reference.refusal(got, "an entry of one of them", "give the entries different names")
        return having[0], name

    def _read(self) -> dict[str, XmlElement]:
        if self._catalogs is None:
            self._catalogs = {}
            for folder in self._folders:
                path = self._sources.find(folder.attributes.get("path", ""), self._file, folder)
                for file in sorted(path.glob(ENDING)) if path.is_dir() else [path]:
                    root = self._sources.root(file, folder.place)
                    for catalog in root.children:
                        if catalog.tag == "Catalog":
                            self._catalogs.setdefault(catalog.attributes.get("name", ""), catalog)
        return self._catalogs


def _folders(kind: XmlElement) -> list[XmlElement]:
    kind.used = True
    folders = kind.all("Directory")
    for folder in folders:
        folder.attribute("path")
    return folders


def _names(catalog: XmlElement | None) -> set[str]:
    return {entry.attributes.get("name", "") for entry in catalog.children} if catalog else set()


def assignments(reference: At) -> dict[str, Meaning]:
    """Returns the values that a reference assigns to an entry's parameters, as its own scope has them."""
    block = reference.maybe("ParameterAssignments")
    return (
        {one.constant("parameterRef"): one.meaning("value") for one in block.all("ParameterAssignment")}
        if block
        else {}
    )


def parametrised(at: At, assigned: Mapping[str, Meaning]) -> At:
    """Returns an element with its own `ParameterDeclarations` in its scope.

    Args:
      at: the element, in the scope outside it.
      assigned: value of a parameter in place of the declared one.

    Raises:
      ConfigError: a value names a parameter that is not declared before it, or an assigned one is not declared.
    """
    own = dict[str, Meaning]()
    block = at.maybe("ParameterDeclarations")
    for declaration in block.all("ParameterDeclaration") if block else ():
        declared = read_declaration(declaration)
        if declared.name in assigned:
            meaning = assigned[declared.name]
        else:
            meaning = At(declaration.element, at.scope.inner(own)).meaning("value")
        if meaning.expression is None and declared.kind not in TEXTS:
            raise declaration.refusal(f"{declared.name} = {meaning.text[:80]!r}", f"a value of type {declared.kind}")
        own[declared.name] = meaning
        for group in declaration.all("ConstraintGroup"):
            group.element.use_all()
    if unknown := sorted(assigned.keys() - own.keys()):
        raise at.unknown("a value for the parameter", unknown[0], own)
    return At(at.element, at.scope.inner(own)) if own else at
