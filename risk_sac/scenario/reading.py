"""Reads a scenario document from YAML or JSON, and locates faults by path."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from risk_sac.config import Scenario
from risk_sac.config.base import UNKNOWN_FIELD, Location, dotted, field_error, read_text
from risk_sac.errors import ConfigError

MOST_BYTES = 200_000  # of a document; choice: the shipped ones have up to 5,000
MOST_JSON_BYTES = 4_000_000  # which is read faster; choice: recorded trajectories of 20 actors have some 1,000,000
MOST_NODES = 50_000  # values of a document, with what its aliases repeat
DEEPEST = 30
EXPECTED = "a scenario document: fields such as `name`, `network`, `ego` and `actors`"


def read_document(file: Path, field: str = "scenario") -> Scenario:
    """Reads a document from a file; raises `ConfigError`, with `others` if more than one thing is wrong."""
    if file.is_file() and file.stat().st_size > MOST_JSON_BYTES:
        raise too_long(file.stat().st_size, MOST_JSON_BYTES)
    return document_from(read_text(file, field))


def document_from(text: str) -> Scenario:
    """Reads a document from text.

    Args:
      text: YAML or JSON.

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
    """All nodes below one, what aliases repeat included; raises `ConfigError` where a name is there twice."""
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
    """Of errors at one path, which are the alternatives of a field, the one that says most."""
    own = [item for item in items if isinstance(item.get("ctx", {}).get("error"), ConfigError)]
    return field_error((own or items)[-1 if not own else 0], Scenario)


def _in_document(location: Location, fields: Any, *, missing: bool) -> Location:
    """A location without the names that pydantic gives to the alternatives of a field."""
    path, here = list[int | str](), fields
    for i, part in enumerate(location):
        inner: Any = dict(enumerate(here)) if isinstance(here, list) else here
        if isinstance(inner, dict) and part in inner:
            here = inner[part]
        elif not (missing and i == len(location) - 1):
            continue
        path.append(part)
    return tuple(path)
