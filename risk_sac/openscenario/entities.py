"""Entities of a scenario, and entries of the catalogs that describe them."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from risk_sac.config.base import Chosen
from risk_sac.config.scenario import EGO, Box
from risk_sac.openscenario.parameters import TEXTS, read_declaration
from risk_sac.openscenario.scope import At, Meaning, Text
from risk_sac.openscenario.sources import SourceFiles, XmlElement
from risk_sac.scenario.bodies import BODIES, BodyName

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
        """Notes the folders of `CatalogLocations`; files are read on demand."""
        self._sources, self._file = sources, file
        self._folders = (
            [folder for kind in locations.element.children for folder in _folders(kind)] if locations else []
        )
        self._catalogs: dict[str, XmlElement] | None = None
        self._references = 0

    def entry(self, reference: At, catalog: str, name: str, *tags: str) -> At:
        """Returns a catalog entry with the reference's assignments as its parameters.

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
        """Returns a reference's entry, or one for each word of a parameter.

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
        """Returns catalog and entry; of several catalogs the one with the entry."""
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
    """Returns the values that a reference assigns, evaluated in its own scope."""
    block = reference.maybe("ParameterAssignments")
    return (
        {one.constant("parameterRef"): one.meaning("value") for one in block.all("ParameterAssignment")}
        if block
        else {}
    )


def parametrised(at: At, assigned: Mapping[str, Meaning]) -> At:
    """Returns an element in a scope with its declared or assigned parameters.

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


KINDS = ("Vehicle", "Pedestrian", "MiscObject")
MOST = 100
_FREE = ("pedestrian", "child")
_VEHICLES: Mapping[str, tuple[BodyName, ...]] = {
    "car": ("car", "van"),
    "van": ("van", "car"),
    "truck": ("truck", "van"),
    "trailer": ("truck",),
    "semitrailer": ("truck",),
    "bus": ("bus",),
    "motorbike": ("motorcycle",),
    "bicycle": ("bicycle",),
    "train": ("bus",),
    "tram": ("bus",),
    "standup_scooter": ("bicycle",),
    "wheelchair": ("pedestrian",),
    "work_machine": ("truck",),
}
"""vehicleCategory → bodies, of which the one of the nearest size is taken."""
_CHILD_M = 1.4  # height below which a pedestrian is a child; choice


@dataclass(frozen=True)
class Entity:
    """An object of the scenario."""

    at: At
    name: str
    """In the document."""
    body: str | Chosen[str]
    box: Box | Chosen[Box] | None
    entry: str
    """Its catalog and entry, such as `vehicle_catalog/car`; empty: it has none, or a parameter chooses it."""
    freely: bool | None
    """Whether it moves anywhere, as a pedestrian; None: as a parameter's word has it."""


class Entities:
    """All entities of a scenario file, by the file's names."""

    def __init__(self, block: At, catalogs: Catalogs, ego: str | None) -> None:
        """Reads the element `Entities`.

        The ego is that of this name; by None the one that is named Ego, or the only one with a controller.

        Raises:
          ConfigError: there is no ego or more than one, or an entity cannot be read.
        """
        self._catalogs = catalogs
        self._names: dict[str, str] = {}
        objects = block.all("ScenarioObject")
        if len(objects) > MOST:
            raise block.refusal(f"{len(objects)} entities", f"at most {MOST}")
        given = [at.constant("name") for at in objects]
        for at, name in zip(objects, given, strict=True):
            if given.count(name) > 1:
                raise at.refusal(f"the name {name[:80]!r} once more", "each name once")
        self.ego = _ego(block, objects, ego)
        self._names = _document_names(given, self.ego)
        self._groups = {at.constant("name"): at for at in block.all("EntitySelection")}
        self.all = {name: self._read(at, name) for at, name in zip(objects, given, strict=True)}

    def named(self, at: At, attribute: str = "entityRef") -> str:
        """Returns the document's name of one entity; raises `ConfigError` for a selection."""
        names = self.members(at, attribute)
        if len(names) != 1:
            raise at.refusal(f"{attribute}, a selection of {len(names)} entities", "one entity")
        return names[0]

    def members(self, at: At, attribute: str = "entityRef") -> tuple[str, ...]:
        """Returns the document's names of an entity or of a selection."""
        name = at.constant(attribute)
        if name in self._names:
            return (self._names[name],)
        if name in self._groups:
            selection = self._groups[name].one("Members")
            return tuple(member for ref in selection.all("EntityRef") for member in self._own(ref))
        raise at.unknown(attribute, name, [*self._names, *self._groups])

    def _own(self, at: At) -> tuple[str, ...]:
        name = at.constant("entityRef")
        if name not in self._names:
            raise at.unknown("entityRef", name, self._names)
        return (self._names[name],)

    def _read(self, at: At, given: str) -> Entity:
        name = self._names[given]
        inline = at.maybe(*KINDS)
        if inline is not None:
            entries: At | Alternatives = parametrised(inline, {})
        elif (reference := at.maybe("CatalogReference")) is not None:
            entries = self._catalogs.alternatives(reference, *KINDS)
        else:
            tags = ", ".join(dict.fromkeys(child.tag for child in at.element.children)) or "nothing"
            raise at.refusal(f"an entity with {tags[:200]}", f"one of {', '.join(KINDS)} and CatalogReference")
        for controller in at.all("ObjectController"):
            controller.element.use_all()
        of = entries.of if isinstance(entries, Alternatives) else {"": entries}
        bodies = {word: _body(entry) for word, entry in of.items()}
        boxes = {word: _box(entry) for word, entry in of.items()}
        free = {body in _FREE for body in bodies.values()}
        chosen = entries.by if isinstance(entries, Alternatives) else None
        same = chosen is None or (len(set(bodies.values())) == 1 and len(set(boxes.values())) == 1)
        return Entity(
            at=at,
            name=name,
            body=next(iter(bodies.values())) if same or chosen is None else Chosen[str](by=chosen, of=bodies),
            box=next(iter(boxes.values())) if same or chosen is None else Chosen[Box](by=chosen, of=boxes),
            entry="" if inline is not None or chosen is not None else _entry(at),
            freely=free.pop() if len(free) == 1 else None,
        )


def _body(entry: At) -> BodyName:
    box = _box(entry)
    if entry.tag == "Vehicle":
        category = entry.constant("vehicleCategory", "car")
        near = min(_VEHICLES.get(category, ("car",)), key=lambda name: _difference(name, box))
        if category not in _VEHICLES:
            near = min(("car", "van", "truck", "bus"), key=lambda name: _difference(name, box))
    elif entry.tag == "Pedestrian":
        height = entry.one("BoundingBox").one("Dimensions").number("height")
        near = "child" if isinstance(height, float) and height < _CHILD_M else "pedestrian"
    else:
        near = "obstacle"
    return near


def _entry(at: At) -> str:
    reference = at.one("CatalogReference")
    return f"{reference.constant('catalogName')}/{reference.constant('entryName')}"[:200]


def _difference(name: str, box: Box) -> float:
    body = BODIES[name]  # type: ignore[index] # a row of the table
    return abs(body.length_m - box.length_m) + abs(body.width_m - box.width_m)


def _box(entry: At) -> Box:
    box = entry.one("BoundingBox")
    size, centre = box.one("Dimensions"), box.one("Center")
    ahead, left = centre.number("x"), centre.number("y")
    for value in (size.number("height"), centre.number("z")):
        del value  # read, since nothing is above or below another thing here
    numbers = [size.number("length"), size.number("width"), ahead]
    if not all(isinstance(value, float) for value in numbers) or left != 0.0:
        raise box.refusal("a box whose size varies, or whose middle is not ahead of the reference point", "constants")
    return box.build(Box, length_m=numbers[0], width_m=numbers[1], ahead_m=numbers[2])


def _ego(block: At, objects: list[At], wanted: str | None) -> str:
    names = [at.constant("name") for at in objects]
    if wanted is not None:
        if wanted not in names:
            raise block.unknown("the ego", wanted, names)
        return wanted
    called = [name for name in names if name.lower() in ("ego", "ego_vehicle", "hero")]
    controlled = [at.constant("name") for at in objects if at.maybe("ObjectController")]
    exact = [name for name in called if name == "Ego"]
    egos = exact if len(exact) == 1 else called or controlled
    if len(egos) != 1:
        got = (
            f"{len(egos)} egos: {', '.join(egos)[:200]}" if egos else "no entity that is named Ego or has a controller"
        )
        raise block.refusal(got, "one ego", "name it: --ego-entity NAME, over REST ego_entity=NAME")
    return egos[0]


def _document_names(given: list[str], ego: str) -> dict[str, str]:
    """Returns each entity's name in the document, without invalid characters."""
    names = {ego: EGO}
    for name in given:
        if name == ego:
            continue
        plain = re.sub(r"\W", "_", name, flags=re.ASCII)[:60]
        plain = plain if plain[:1].isalpha() or plain[:1] == "_" else f"_{plain}"
        while plain in names.values():
            plain = f"{plain}_"
        names[name] = plain
    return names
