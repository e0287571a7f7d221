"""`python -m service.host.settings_table [FILE]`: write the table of environment variables into service/README.md."""

import json
import sys
from pathlib import Path
from typing import Any

from service.settings import ServiceSettings

BEGIN = "<!-- settings: written by `make settings` -->"
END = "<!-- /settings -->"
BOUNDS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤"}
TYPES = {"array": "JSON list", "path": "folder", "file-path": "file", "string": "text"}


def table() -> str:
    """The settings as a markdown table: variable, what it takes, its default, its meaning."""
    prefix = ServiceSettings.model_config["env_prefix"]
    rows = [
        f"| `{prefix}{name.upper()}` | {takes(field)} | {_default(field)} | {' '.join(field['description'].split())} |"
        for name, field in sorted(ServiceSettings.model_json_schema()["properties"].items(), key=_of_ray)
    ]
    return "\n".join(["| variable | takes | default | meaning |", "|---|---|---|---|", *rows])


def _of_ray(setting: tuple[str, dict[str, Any]]) -> bool:
    """They come last; all others stay in their order."""
    return setting[0].startswith("ray_")


def with_table(text: str) -> str:
    """The text with the table between its two marks."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"the text lacks {BEGIN!r} or, behind it, {END!r}; put both where the table belongs")
    return f"{before}{begin}\n{table()}\n{end}{after}"


def takes(field: dict[str, Any]) -> str:
    """What a setting takes, by its JSON schema."""
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
    """As it would be written; a dash where it means none or depends on the machine."""
    default = field.get("default")
    if default is None:
        return "–"
    return f"`{json.dumps(default) if isinstance(default, list) else default}`"


if __name__ == "__main__":
    readme = Path(sys.argv[1] if len(sys.argv) > 1 else "service/README.md")
    readme.write_text(with_table(readme.read_text(encoding="utf-8")), encoding="utf-8")
