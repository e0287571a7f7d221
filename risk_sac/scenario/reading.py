"""Reads scenario documents, locates faults by path, and lists the shipped ones."""

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from risk_sac.config import Scenario
from risk_sac.config.base import UNKNOWN_FIELD, Chosen, Location, dotted, field_error, read_text
from risk_sac.errors import ConfigError, did_you_mean

MOST_BYTES = 200_000  # of a document; choice: the shipped ones have up to 5,000
MOST_JSON_BYTES = 4_000_000  # which is read faster; choice: recorded trajectories of 20 actors have some 1,000,000
MOST_NODES = 50_000  # values of a document, with what its aliases repeat
DEEPEST = 30
EXPECTED = "a scenario document: fields such as `name`, `network`, `ego` and `actors`"


def read_document(file: Path, field: str = "scenario") -> Scenario:
    """Reads a document file; raises `ConfigError`, with `others` for further faults."""
    if file.is_file() and file.stat().st_size > MOST_JSON_BYTES:
        raise too_long(file.stat().st_size, MOST_JSON_BYTES)
    return document_from(read_text(file, field))


def document_from(text: str) -> Scenario:
    """Reads a document from YAML or JSON.

    Raises:
      ConfigError: it is too long, no YAML, names a field twice, or is no document; `field` is the path.
    """
    most = MOST_JSON_BYTES if text.lstrip().startswith("{") else MOST_BYTES
    if (size := len(text.encode())) > most:
        raise too_long(size, most)
    return document_from_fields(_fields(text))


def document_from_fields(fields: Any) -> Scenario:
    """Reads a document from its fields; raises `ConfigError` as `document_from` does."""
    if not isinstance(fields, dict):
        raise ConfigError("", f"a document that is a {type(fields).__name__}", EXPECTED)
    try:
        return Scenario.model_validate(fields)
    except ValidationError as error:
        faults = _faults(error, fields)
        faults[0].others = tuple(faults[1:])
        raise faults[0] from error


def too_long(size: int, most: int = MOST_BYTES) -> ConfigError:
    """Returns the error of a document that is too long."""
    return ConfigError("document", f"{size} bytes", f"at most {most}", "put roads into a net beside it")


def _fields(text: str) -> Any:
    if text.lstrip().startswith("{"):
        try:
            return json.loads(text, object_pairs_hook=_once)
        except RecursionError:
            raise ConfigError("", "a document that is nested too deep", f"at most {DEEPEST} levels") from None
        except ConfigError:
            raise
        except ValueError as error:
            if len(text) > MOST_BYTES:
                raise ConfigError("", f"no JSON: {error}", EXPECTED) from error
            # YAML may begin so, too
    try:
        node = yaml.compose(text, yaml.SafeLoader)
        if node is None:
            raise ConfigError("", "an empty document", EXPECTED)
        for number, _ in enumerate(_nodes(node, (), 0)):
            if number >= MOST_NODES:
                raise ConfigError("", f"more than {MOST_NODES} values", "fewer", "write fewer aliases")
        return yaml.safe_load(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f" from line {mark.line + 1}, column {mark.column + 1} on: {error.problem}" if mark else ""
        raise ConfigError("", f"no YAML{where}", EXPECTED) from error
    except ConfigError:
        raise
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError("", f"no YAML: {error or 'it is nested too deep'}".partition("\n")[0], EXPECTED) from error


def _once(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(name, "a name that is there twice", "each name once", "rename or remove one")
    return dict(pairs)


def _nodes(node: yaml.Node, path: Location, depth: int) -> Iterator[yaml.Node]:
    """Yields all nodes below one, aliases repeated; raises `ConfigError` for duplicate names."""
    if depth > DEEPEST:
        raise ConfigError(dotted(path[:5]), "a value that is nested too deep", f"at most {DEEPEST} levels")
    yield node
    if isinstance(node, yaml.MappingNode):
        names = set[str]()
        for key, value in node.value:
            name = str(key.value)
            if name in names:
                got = f"a name that is there twice, again in line {key.start_mark.line + 1}"
                raise ConfigError(dotted((*path, name)), got, "each name once", "rename or remove one")
            names.add(name)
            yield from _nodes(value, (*path, name), depth + 1)
    elif isinstance(node, yaml.SequenceNode):
        for i, value in enumerate(node.value):
            yield from _nodes(value, (*path, i), depth + 1)


def _faults(error: ValidationError, fields: Any) -> list[ConfigError]:
    """Returns one error for each path, unknown names first."""
    by_path: dict[Location, list[Mapping[str, Any]]] = {}
    for item in error.errors():
        path = _in_document(item["loc"], fields, missing=item["type"] == "missing")
        by_path.setdefault(path, []).append(item | {"loc": path})
    paths = [
        path for path in by_path if not any(len(other) > len(path) and other[: len(path)] == path for other in by_path)
    ]
    paths = [path for path in paths if by_path[path][0]["type"] == UNKNOWN_FIELD] + [
        path for path in paths if by_path[path][0]["type"] != UNKNOWN_FIELD
    ]
    return [_fault(by_path[path]) for path in paths]


def _fault(items: Sequence[Mapping[str, Any]]) -> ConfigError:
    """Chooses the most informative of the errors of a field's alternatives."""
    own = [item for item in items if isinstance(item.get("ctx", {}).get("error"), ConfigError)]
    return field_error((own or items)[-1 if not own else 0], Scenario)


def _in_document(location: Location, fields: Any, *, missing: bool) -> Location:
    """Returns a location without pydantic's names of a field's alternatives."""
    path, here = list[int | str](), fields
    for i, part in enumerate(location):
        inner: Any = dict(enumerate(here)) if isinstance(here, list) else here
        if isinstance(inner, dict) and part in inner:
            here = inner[part]
        elif not (missing and i == len(location) - 1):
            continue
        path.append(part)
    return tuple(path)


FOLDER = Path(str(files("sumo_nets")))
PAPER_FAMILIES = ("low", "mixed", "dense")  # families of the paper, which have libraries


def scenario_file(name: str) -> Path:
    """Returns the file of a shipped document; it may not be there."""
    return FOLDER / name / f"{name}.yaml"


@cache
def shipped_names() -> tuple[str, ...]:
    """Names of shipped scenarios: the paper's families, then others by name."""
    others = sorted(path.parent.name for path in FOLDER.glob("*/*.yaml") if path.parent.name == path.stem)
    return (*PAPER_FAMILIES, *(name for name in others if name not in PAPER_FAMILIES))


@cache
def shipped_document(name: str) -> Scenario:
    """Reads a shipped document; raises `ConfigError` for an unknown name."""
    if name not in shipped_names():
        known = shipped_names()
        raise ConfigError("scenario", repr(name), f"one of {', '.join(known)}", did_you_mean(name, known))
    return document_from(scenario_file(name).read_text())


def shipped_net(name: str, remedy: str = "") -> str:
    """Returns a shipped net's file below `sumo_nets/`; raises `ConfigError` with the remedy."""
    known = sorted(path.parent.name for path in FOLDER.glob("*/*.net.xml"))
    if name not in known:
        raise ConfigError("network", repr(name), f"a net beside the document, or one of {', '.join(known)}", remedy)
    return f"{name}/{name}.net.xml"


def networks(document: Scenario) -> Iterator[str]:
    """All networks that a document names."""
    yield from alternatives(document, document.network)


def roads(document: Scenario) -> Iterator[str]:
    """All road files that a document names."""
    if document.road is not None:
        yield from alternatives(document, document.road)


def alternatives(document: Scenario, name: str | Chosen[str]) -> tuple[str, ...]:
    """Returns all names that a field may have, over parameters' words."""
    return document.words.get(name, (name,)) if isinstance(name, str) else tuple(name.of.values())


def nets_of(document: Scenario, folder: Path | None = None) -> Mapping[str, str]:
    """Finds the file of each network that a document names.

    Its own lie beside a folder, if there is one.

    Raises:
      ConfigError: a net or a road file is not there.
    """
    for name in roads(document):
        if folder is None or not _beside(name, folder):
            raise ConfigError("road", repr(name), "an OpenDRIVE file beside the document and its net")
    nets = {}
    for name in networks(document):
        if folder is not None and _beside(name, folder):
            nets[name] = str((folder / name).absolute())
        else:
            beside = folder is not None and _beside(f"{name}.net.xml", folder)
            nets[name] = shipped_net(name, f"did you mean {name}.net.xml?" if beside else "")
    return nets


def _beside(name: str, folder: Path) -> bool:
    return "/" not in name and not name.startswith(".") and (folder / name).is_file()
