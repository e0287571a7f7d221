"""Text that a user wrote."""

import codecs
import json
from pathlib import Path
from typing import Any

import yaml

from risk_sac.errors import ConfigError

FIELDS = "fields and their values, such as `family: low`"
MARKS = {  # the longer ones first
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF8: "UTF-8-sig",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}


def read_text(file: Path, field: str) -> str:
    """Reads a text file in UTF-8 or its byte order mark's encoding.

    Lines end with a line feed.

    Raises:
      ConfigError: it cannot be read, or is no text; it names the field.
    """
    try:
        content = file.read_bytes()
    except OSError as error:
        got = f"{file}, which cannot be read ({error.strerror})"
        raise ConfigError(field, got, "a text file", "check its path") from error
    encoding = next((name for mark, name in MARKS.items() if content.startswith(mark)), "UTF-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        got = f"{file}, which is no {encoding.removesuffix('-sig')} from byte {error.start} on"
        raise ConfigError(field, got, "a text file", "save it as UTF-8") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_fields(file: Path, field: str) -> dict[str, Any]:
    """Read a mapping from a file of YAML or JSON.

    Raises:
      ConfigError: it is neither, or holds something else; it names the field.
    """
    text = read_text(file, field)
    try:
        data = _parsed(text)
    except (yaml.YAMLError, RecursionError) as error:
        raise ConfigError(field, f"{file}, which is no YAML{_place_of(error)}", FIELDS, "mend it there") from error
    if not isinstance(data, dict):
        raise ConfigError(field, f"{file}, which holds a {type(data).__name__}", FIELDS)
    return data


def _place_of(error: Exception) -> str:
    """Returns where a text stops being YAML, and why."""
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem_mark is None:
        return f": {error or 'it is nested too deep'}"
    mark = error.problem_mark
    return f" from line {mark.line + 1}, column {mark.column + 1} on: {error.problem}"


def _parsed(text: str) -> Any:
    """JSON by its own rules, since YAML takes no tabs and reads 1e-7 as a word."""
    if text.lstrip().startswith("{"):
        try:
            return json.loads(text)
        except ValueError:
            pass  # YAML may begin so, too
    return yaml.safe_load(text)
