"""Settings from the environment, and their table in service/settings.md.

`python -m service.host.environment [FILE]` writes the table.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from risk_sac.errors import ConfigError
from service.settings import SECRETS, ServiceSettings

MISUSED = 2  # exit status of a command whose settings are wrong, as of `risk-sac`
LONGEST_VALUE = 80
BEGIN = "<!-- settings: written by `make settings` -->"
END = "<!-- /settings -->"
BOUNDS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤"}
TYPES = {"array": "JSON list", "path": "folder", "file-path": "file", "string": "text"}


def read_settings() -> ServiceSettings:
    """The settings of this process.

    Raises:
      ConfigError: some are wrong, one line each; or the folder of secrets is missing, or cannot be read.
    """
    _check_secrets()
    try:
        return ServiceSettings()
    except ValidationError as error:
        # A default that depends on other settings is not wrong because they are.
        wrong = [each for each in error.errors() if each["type"] != "default_factory_not_called"]
        raise ConfigError("", "\n".join(dict.fromkeys(map(_line, wrong)))) from error
    except OSError as error:
        raise ConfigError("", f"secret {error.filename!r} cannot be read ({error.strerror})") from error


def _check_secrets() -> None:
    if SECRETS and not Path(SECRETS).is_dir():
        what = "no folder" if os.path.lexists(SECRETS) else "missing"
        name = _variable("secrets_dir")
        raise ConfigError(name, f"{SECRETS!r}, which is {what}", "a folder that has settings as files")


def _line(error: ErrorDetails) -> str:
    """Describes one wrong setting, or the wrong entry of its list."""
    name, *item = error["loc"]
    field = ServiceSettings.model_json_schema()["properties"][name]
    text = repr(error["input"])
    shown = text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"
    return str(ConfigError(_variable(str(name)), shown, takes(field["items"] if item else field)))


def _variable(name: str) -> str:
    return f"{ServiceSettings.model_config['env_prefix']}{name.upper()}"


def table() -> str:
    """Returns the settings as a Markdown table."""
    settings = ServiceSettings.model_json_schema()["properties"]
    rows = [
        f"| `{_variable(name)}` | {takes(field)} | {_default(field)} | {' '.join(field['description'].split())} |"
        for name, field in sorted(settings.items(), key=lambda setting: setting[0].startswith("ray_"))  # they come last
    ]
    return "\n".join(["| variable | takes | default | meaning |", "|---|---|---|---|", *rows])


def with_table(text: str) -> str:
    """The text with the table between its two marks."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"the text lacks {BEGIN!r} or, behind it, {END!r}; put both where the table belongs")
    return f"{before}{begin}\n{table()}\n{end}{after}"


def takes(field: dict[str, Any]) -> str:
    """Returns what a setting takes, by its JSON schema."""
    if "anyOf" in field:  # one of them is null, which is what no variable means
        return next(takes(each) for each in field["anyOf"] if each["type"] != "null")
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return " or ".join(f"`{each}`" for each in field["enum"])
    bounds = ", ".join(f"{sign} {field[name]:g}" for name, sign in BOUNDS.items() if name in field)
    kind = field.get("format", field["type"])
    return f"{TYPES.get(kind, kind)} {bounds}".strip()


def _default(field: dict[str, Any]) -> str:
    """Returns the default as a user writes it; a dash for none or machine-dependent ones."""
    default = field.get("default")
    if default is None:
        return "–"
    return f"`{json.dumps(default) if isinstance(default, list) else default}`"


if __name__ == "__main__":
    page = Path(sys.argv[1] if len(sys.argv) > 1 else "service/settings.md")
    page.write_text(with_table(page.read_text(encoding="utf-8")), encoding="utf-8")
