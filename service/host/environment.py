"""The settings as the environment gives them; what is wrong with them is said in one line each."""

import os
from pathlib import Path

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from risk_sac.errors import ConfigError
from service.host.settings_table import takes
from service.settings import SECRETS, ServiceSettings

MISUSED = 2  # exit status of a command whose settings are wrong, as of `risk-sac`
LONGEST_VALUE = 80


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
    """What one setting is, or what is in its list, and what it should be."""
    name, *item = error["loc"]
    field = ServiceSettings.model_json_schema()["properties"][name]
    text = repr(error["input"])
    shown = text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}…"
    return str(ConfigError(_variable(str(name)), shown, takes(field["items"] if item else field)))


def _variable(name: str) -> str:
    return f"{ServiceSettings.model_config['env_prefix']}{name.upper()}"
