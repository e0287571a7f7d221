"""Describes registered egos without running them: a Python ego's card is read from its source."""

import ast
import hashlib
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from risk_sac.config import Settings
from risk_sac.config.ego import EgoName
from risk_sac.config.invalid import field_error
from risk_sac.errors import ConfigError

HASH_DIGITS = 12
PYTHON_DEADLINE_S = 60.0  # generous: in our own process the first answer waits for a compiler, on whatever machine


class EgoCard(Settings):
    """A registered ego."""

    name: EgoName
    """What `ego.driver` of a campaign names."""
    kind: Literal["python", "remote"]
    """python: in the worker's own process; remote: a process that speaks the protocol of `risk_sac.egos.remote`."""
    version: Annotated[str, Field(min_length=1, max_length=100)]
    """As it declares it; of a Python ego followed by a hash of its source."""
    response_time_s: Annotated[float, Field(ge=0, le=5)]
    """Within which it responds to a danger, s."""
    deadline_s: Annotated[float, Field(gt=0, le=600)]
    """For each of its answers, s of real time; an episode in which it misses it is invalid."""
    summary: Annotated[str, Field(max_length=500)] = ""
    """In a sentence."""


def python_card(point: EntryPoint) -> EgoCard:
    """Returns the card of the class that an entry point names; a ConfigError if it does not declare all of it."""
    file = _source(point)
    try:
        declared = _declared(file.read_text(encoding="utf-8"), point.attr)
        declared["version"] = f"{declared.get('version', '')}+{_hash(file, '.' in point.module)}"
        return EgoCard(name=point.name, kind="python", **{"deadline_s": PYTHON_DEADLINE_S} | declared)
    except (OSError, SyntaxError, UnicodeDecodeError) as error:
        raise _wrong(point, f"{file.name} cannot be read: {error}") from error
    except ValidationError as error:
        raise _wrong(point, str(field_error(error.errors()[0]))) from error


def _source(point: EntryPoint) -> Path:
    try:
        found = find_spec(point.module)
    except ImportError as error:
        raise _wrong(point, str(error)) from error
    if found is None or not found.origin or not found.origin.endswith(".py"):
        raise _wrong(point, f"there is no module {point.module!r} with a source")
    return Path(found.origin)


def _declared(source: str, name: str) -> dict[str, Any]:
    """The literals that a class declares of itself."""
    for node in ast.parse(source).body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            return {"summary": (ast.get_docstring(node) or "").partition("\n")[0]} | {
                target.id: each.value.value
                for each in node.body
                if isinstance(each, ast.Assign) and isinstance(each.value, ast.Constant)
                for target in each.targets
                if isinstance(target, ast.Name) and target.id in ("version", "response_time_s", "deadline_s")
            }
    raise SyntaxError(f"it has no class {name!r}")


def _hash(file: Path, in_package: bool) -> str:
    """Of a module's source, and of those beside it in its package, which it may be made of."""
    digest = hashlib.sha256()
    for each in sorted(file.parent.glob("*.py")) if in_package else [file]:
        digest.update(each.name.encode() + b"\0" + each.read_bytes() + b"\0")
    return digest.hexdigest()[:HASH_DIGITS]


def _wrong(point: EntryPoint, why: str) -> ConfigError:
    return ConfigError("ego.driver", f"the registered ego {point.name!r} ({point.value}) cannot be used: {why}")
