"""`python -m service.openapi [FILE]`: write the API's description."""

import sys
from pathlib import Path

import yaml

from service.api.description import openapi
from service.app import create_app
from service.settings import ServiceSettings


def document() -> str:
    """The OpenAPI document as YAML, in the order in which the routes are declared."""
    return yaml.safe_dump(openapi(create_app(ServiceSettings())), sort_keys=False, allow_unicode=True, width=120)


if __name__ == "__main__":
    Path(sys.argv[1] if len(sys.argv) > 1 else "openapi.yaml").write_text(document(), encoding="utf-8")
