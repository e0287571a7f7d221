"""Imports a scenario file, or variation with its scenario, as a document."""

import math
import re
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pydantic import ValidationError

from risk_sac.config.base import Chosen, field_errors
from risk_sac.config.scenario import EGO, Actor, ImportOrigin, Moving, Scenario, Start
from risk_sac.config.story import Story
from risk_sac.config.story_actions import FollowTrajectoryAction
from risk_sac.errors import ConfigError
from risk_sac.maps.convert import present_net
from risk_sac.maps.documents import MAX_BYTES
from risk_sac.openscenario.actions import ActionReader, Variables
from risk_sac.openscenario.conditions import ConditionReader
from risk_sac.openscenario.distributions import NO_SCOPE, Variation, points_of
from risk_sac.openscenario.entities import Catalogs, Entities, Entity
from risk_sac.openscenario.parameters import Parameters, Varied, allowed, constraints_of
from risk_sac.openscenario.positions import Positions
from risk_sac.openscenario.scope import At, NameScope, Text
from risk_sac.openscenario.sources import SourceFiles, XmlElement, plain
from risk_sac.openscenario.storyboard import Init, StoryboardReader, horizon_of, moving_actors

_VARIATION = "ParameterValueDistribution"
_LONGEST_NAME, _LONGEST_SUMMARY = 40, 300


@dataclass
class RoadFiles:
    """Nets and road files of a document, by name."""

    network: Text
    road: Text
    files: dict[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Imported:
    """A scenario document with files; its origin lists differences from the source."""

    document: Scenario
    files: dict[str, bytes]
    """Nets and road files, by the document's names."""
    places: dict[str, str]
    """Path in the document → file, line and element that it comes from."""
    points: int
    """Of the grid that a variation file spans, with those that are left out; a range without a step counts once."""

    def located(self, error: ConfigError) -> ConfigError:
        """Adds to a document's error the place in the source file."""
        path = next((path for path in self.places if error.field.startswith(path)), "")
        field = ": ".join(filter(None, (self.places.get(path, ""), error.field)))
        return ConfigError(field, error.got, error.expected, error.remedy)


def import_scenario(file: Path, within: Path | None = None, ego: str | None = None) -> Imported:
    """Reads a scenario or variation file of OpenSCENARIO XML 1.0 to 1.3.

    Args:
      file: to read.
      within: the folder that no other file may lie outside of; None: any that the user may read.
      ego: the entity that is the ego; None: the one that is named Ego, or the only one with a controller.

    Raises:
      ConfigError: with file, line and element of what is wrong, or cannot be read and matters.
    """
    try:
        return _Import(SourceFiles(within), ego).read(file.absolute())
    except ConfigError as error:
        error.field = error.field or file.name
        raise
    except RecursionError:
        raise ConfigError(file.name, "elements or parameters that are nested too deep", "less depth") from None


class _Import:
    """One import."""

    def __init__(self, sources: SourceFiles, ego: str | None) -> None:
        self._sources, self._ego = sources, ego
        self._remarks: list[str] = []

    def read(self, file: Path) -> Imported:
        name, root = file.stem, self._sources.root(file, "scenario")
        variation = At(root, NO_SCOPE).maybe(_VARIATION)
        if variation is not None:
            at = variation.one("ScenarioFile")
            file = self._sources.find(at.constant("filepath"), file, at.element)
            root = self._sources.root(file, at.element.place)
        if not any(child.tag == "Storyboard" for child in root.children):
            tags = ", ".join(dict.fromkeys(child.tag for child in root.children))[:200] or "nothing"
            remedy = "name the scenario file that uses it" if "Catalog" in tags else ""
            raise root.refusal(f"a file of {tags}", "a scenario, or a variation of one", remedy)
        imported = self._scenario(At(root, NO_SCOPE), file, name, variation)
        self._remarks += [line for read in self._sources.roots for line in unread(read)]
        remarks = tuple(plain(line[:1000]) for line in dict.fromkeys(self._remarks))[:1000]
        origin = imported.document.origin
        assert origin is not None
        document = imported.document.model_copy(update={"origin": origin.model_copy(update={"remarks": remarks})})
        return replace(imported, document=document)

    def _scenario(self, top: At, file: Path, name: str, variation: At | None) -> Imported:
        blocks = top.all("ParameterDeclarations")
        declarations = [at for block in blocks for at in block.all("ParameterDeclaration")]
        attributes = [at.element.attributes for at in declarations]
        types = {own.get("name", ""): own.get("parameterType", "") for own in attributes}
        varied = Variation(types, self._remarks).read(variation) if variation is not None else []
        points = math.prod(points_of(part) for part in varied)
        varied = self._allowed(varied, Parameters(declarations, varied))
        network = top.one("RoadNetwork").one("LogicFile")
        varied = self._with_roads(varied, network, Parameters(declarations, varied).scope, file)
        parameters = Parameters(declarations, varied)
        top = At(top.element, parameters.scope)
        document, roads, places = self._document(top, file, name, parameters)
        return Imported(document, roads.files, places, points)

    def _allowed(self, varied: Sequence[Varied], parameters: Parameters) -> list[Varied]:
        """Leaves out texts that constraints do not allow."""

        def fits(row: dict[str, str] | object) -> bool:
            assert isinstance(row, dict)
            words = {name: text for name, text in row.items() if not parameters.is_number(name)}
            return all(allowed(parameters.declared[name], parameters, text) for name, text in words.items())

        return [self._filtered(part, list(map(fits, part.rows)), "its constraints do not allow it") for part in varied]

    def _with_roads(self, varied: Sequence[Varied], at: At, scope: NameScope, file: Path) -> list[Varied]:
        """Drops words whose road is absent; raises `ConfigError` if none is left."""
        at = At(at.element, scope)
        text = at.text("filepath")
        absent = missing(at, text, self._sources, file)
        by = text.by if isinstance(text, Chosen) else ""
        return [
            self._filtered(part, [row[by] not in absent for row in part.rows], "its road is not there")
            if by in part.names
            else part
            for part in varied
        ]

    def _filtered(self, part: Varied, kept: Sequence[bool], why: str) -> Varied:
        """Leaves out rows, and reports them."""
        if not part.rows or all(kept):
            return part
        for row, keep in zip(part.rows, kept, strict=True):
            if not keep:
                texts = ", ".join(f"{name} = {text}" for name, text in row.items())
                self._remarks.append(f"{part.place.place}: left out: {texts[:300]}: {why}")
        rows = tuple(row for row, keep in zip(part.rows, kept, strict=True) if keep)
        if not rows:
            raise part.place.refusal(f"no value is left of {', '.join(part.names)[:200]}: {why}", "one at least")
        return replace(part, rows=rows, weights=part.weights and part.weights.kept(kept))

    def _document(
        self, top: At, file: Path, name: str, parameters: Parameters
    ) -> tuple[Scenario, RoadFiles, dict[str, str]]:
        catalogs = Catalogs(self._sources, file, top.maybe("CatalogLocations"))
        entities = Entities(top.one("Entities"), catalogs, self._ego)
        block = top.maybe("VariableDeclarations")
        variables = Variables(block.all("VariableDeclaration") if block is not None else [], parameters)
        for element in top.element.below():
            if element.tag == "ParameterAction":
                variables.add(element.attributes.get("parameterRef", ""))
        positions = Positions(catalogs, entities)
        actions = ActionReader(positions, entities, variables, self._remarks)
        conditions = ConditionReader(positions, entities, variables, self._remarks)
        board = StoryboardReader(actions, conditions, entities, catalogs, self._remarks)
        storyboard = top.one("Storyboard")
        init = board.init(storyboard.one("Init"))
        stories, stop = board.stories(storyboard), board.stop(storyboard)
        variables.begin(init.variables)
        for given, text in parameters.texts.items():
            if text and given not in variables.words:
                self._remarks.append(
                    f"{file.name}: {given} = {text[:100]!r} stands for itself, and is no parameter here"
                )
        at = top.one("RoadNetwork").one("LogicFile")
        roads = converted(at, at.text("filepath"), self._sources, file, self._remarks)
        story = storyboard.build(
            Story,
            routes=positions.routes,
            trajectories=positions.trajectories,
            variables=variables.numbers,
            words=variables.words,
            init=tuple(init.actions),
            stories=stories,
            stop=stop,
        )
        horizon = horizon_of(stop, self._remarks)
        constraints = tuple(constraints_of(parameters))
        moved = moving_actors(init, stories)
        actors = {
            entity.name: _actor(entity, init, moves=entity.name in moved)
            for entity in entities.all.values()
            if entity.name != EGO
        }
        ego = entities.all[entities.ego]
        header = top.one("FileHeader")
        fields = {
            "name": _name(name),
            "summary": header.element.attributes.get("description", "")[:_LONGEST_SUMMARY],
            "tags": ("openscenario",),
            "network": roads.network,
            "road": roads.road,
            "horizon_s": horizon,
            "parameters": parameters.document(),
            "ego": Moving(body=ego.body, box=ego.box, speed=init.starts[EGO].speed, start=_start(ego, init)),
            "actors": actors,
            "constraints": constraints,
            "story": story,
            "origin": ImportOrigin(
                file=f"{name}{file.suffix}"[:200],
                actors={entity.name: given[:200] for given, entity in entities.all.items()},
                entries={entity.name: entity.entry for entity in entities.all.values() if entity.entry},
            ),
        }
        try:
            return Scenario(**fields), roads, _places(init, storyboard)
        except ValidationError as error:
            fault = field_errors(error, Scenario)
            fault.field = f"{file.name}: {fault.field}"
            raise fault from error


def _places(init: Init, storyboard: At) -> dict[str, str]:
    """Returns the places of starts, then of all the rest."""
    starts = {name if name == EGO else f"actors.{name}": start.place for name, start in init.starts.items()}
    return {f"{path}.start": place for path, place in starts.items()} | {"": storyboard.element.place}


def _start(entity: Entity, init: Init) -> Start:
    return entity.at.build(Start, position=init.starts[entity.name].position)


def _actor(entity: Entity, init: Init, *, moves: bool) -> Actor:
    """Returns an actor: free for bicycles on trajectories, static if nothing moves."""
    follows = any(one.actor == entity.name and isinstance(one.do, FollowTrajectoryAction) for one in init.actions)
    freely = entity.freely or (entity.body == "bicycle" and follows)
    return entity.at.build(
        Actor,
        role="story" if moves else "static",
        moves="freely" if freely and moves else None,
        body=entity.body,
        box=entity.box,
        speed=init.starts[entity.name].speed,
        start=_start(entity, init),
    )


def _name(stem: str) -> str:
    plain = re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_")
    return (plain if plain[:1].isalpha() else f"scenario_{plain}")[:_LONGEST_NAME].strip("_")


_SILENT = frozenset({"FileHeader", "License", "Properties", "Property", "CatalogLocations", "ParameterDeclarations"})
_EFFECTS = {
    "Performance": "limits are those of the body",
    "Axles": "turning follows the road",
    "TrafficSignals": "signals keep the program of the road",
    "MonitorDeclarations": "nothing is monitored",
    "Trailer": "there is no trailer",
}
_UNKNOWN = "it has no effect"
_MOST_LINES = 10


def unread(root: XmlElement) -> list[str]:
    """Returns a line for each kind of unread element of a file."""
    lines = defaultdict[str, list[int]](list)
    for element in _unused(root):
        lines[element.tag].append(element.line)
    return [
        f"{root.file}, line{'s' if len(at) > 1 else ''} {', '.join(map(str, at[:_MOST_LINES]))}"
        f"{', …' if len(at) > _MOST_LINES else ''}, <{tag[:80]}>: not read; {_EFFECTS.get(tag, _UNKNOWN)}"
        for tag, at in lines.items()
    ]


def _unused(element: XmlElement) -> Iterator[XmlElement]:
    """Yields unread elements within read ones, without other entries of catalogs."""
    for child in element.children:
        if child.used:
            yield from _unused(child)
        elif child.tag not in _SILENT and "Catalog" not in (child.tag, element.tag):
            yield child


MOST_ROADS = 20
_NET, _ROAD = ".net.xml", ".xodr"


def missing(at: At, text: Text, sources: SourceFiles, file: Path) -> list[str]:
    """Returns a parameter's absent road files; raises `ConfigError` if all are absent."""
    if not isinstance(text, Chosen):
        sources.find(text, file, at.element)
        return []
    absent, last = list[str](), None
    for name in dict.fromkeys(text.of.values()):
        try:
            sources.find(name, file, at.element)
        except ConfigError as error:
            absent.append(name)
            last = error
    if last is not None and len(absent) == len(set(text.of.values())):
        raise last
    return absent


def converted(at: At, text: Text, sources: SourceFiles, file: Path, remarks: list[str]) -> RoadFiles:
    """Converts all roads of a scenario; adds their losses to `remarks`.

    Raises:
      ConfigError: a road is not there, is no OpenDRIVE, or cannot be converted.
    """
    names = dict.fromkeys([text] if isinstance(text, str) else text.of.values())
    if len(names) > MOST_ROADS:
        raise at.refusal(f"{len(names)} roads", f"at most {MOST_ROADS}")
    stems, files = dict[str, str](), dict[str, bytes]()
    for name in names:
        path = sources.find(name, file, at.element)
        content = sources.content(path, at.element.place)
        if len(content) > MAX_BYTES or b"<OpenDRIVE" not in content:
            raise at.refusal(f"{name!r}, which is no OpenDRIVE", "an OpenDRIVE file (.xodr)")
        stems[name] = _free_stem(path.stem, files)
        files[stems[name] + _ROAD] = content
        files[stems[name] + _NET] = _net(at, path, remarks)
    if isinstance(text, str):
        return RoadFiles(stems[text] + _NET, stems[text] + _ROAD, files)
    return RoadFiles(_chosen(text, stems, _NET), _chosen(text, stems, _ROAD), files)


def _chosen(text: Chosen[str], stems: Mapping[str, str], ending: str) -> Chosen[str]:
    return Chosen[str](by=text.by, of={word: stems[name] + ending for word, name in text.of.items()})


def _free_stem(stem: str, files: Mapping[str, bytes]) -> str:
    plain = re.sub(r"[^A-Za-z0-9_-]", "_", stem)[:60] or "road"
    while plain + _ROAD in files:
        plain += "_"
    return plain


def _net(at: At, path: Path, remarks: list[str]) -> bytes:
    with tempfile.TemporaryDirectory(prefix="risk-sac-") as folder:
        try:
            net = present_net(path, Path(folder), path.name)
        except ConfigError as error:
            raise at.refusal(f"{path.name}: {error.got}", error.expected, error.remedy) from error
        remarks += [f"{path.name}: {warning}" for warning in net.warnings]
        return re.sub(rb"<!--.*?-->\s*", b"", net.file.read_bytes(), count=1, flags=re.DOTALL)  # it has the time
