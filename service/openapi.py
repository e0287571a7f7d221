"""`python -m service.openapi [FILE]`: write the API's description."""

import sys
from pathlib import Path
from typing import Any

import yaml

from service.api.description import openapi
from service.app import create_app
from service.settings import ServiceSettings

LONGEST = 1000  # characters of what stands on one line


class _Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data: object) -> bool:
        return True

    def represent_mapping(self, tag: str, mapping: Any, flow_style: bool | None = None) -> yaml.MappingNode:
        return super().represent_mapping(tag, mapping, flow_style=len(str(mapping)) <= LONGEST)

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> yaml.SequenceNode:
        plain = not any(isinstance(each, dict | list) for each in sequence)
        return super().represent_sequence(tag, sequence, flow_style=plain or len(str(sequence)) <= LONGEST)


def document() -> str:
    """Returns the OpenAPI document as YAML, in the order of the routes."""
    content = openapi(create_app(ServiceSettings()))
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=LONGEST)


if __name__ == "__main__":
    Path(sys.argv[1] if len(sys.argv) > 1 else "openapi.yaml").write_text(document(), encoding="utf-8")
