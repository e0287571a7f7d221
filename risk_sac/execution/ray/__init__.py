"""Runs on a Ray cluster; its settings are the RISK_SAC_RAY_* environment variables."""

import os
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError
from pydantic_settings import BaseSettings, SettingsConfigDict

from risk_sac.config.base import field_error
from risk_sac.errors import ConfigError


class RaySettings(BaseSettings):
    """Address of the cluster, and the resources of a run."""

    model_config = SettingsConfigDict(
        env_prefix="RISK_SAC_",
        frozen=True,
        use_attribute_docstrings=True,
        secrets_dir=os.environ.get("RISK_SAC_SECRETS_DIR"),
    )

    ray_address: str = "auto"
    """Address of the Ray cluster's head, `HOST:PORT`; `auto`: the cluster that this machine is a part of."""
    ray_cpus_per_run: Annotated[float, Field(gt=0, le=1024)] = 1.0
    """Processors that each process of a run takes of its node."""
    ray_memory_bytes_per_run: Annotated[int, Field(ge=0)] = 1 << 30
    """Memory that each takes, as Ray counts it, bytes; 0 leaves it uncounted."""
    ray_scratch_dir: Path = Path("/tmp/risk-sac")
    """Folder of every node in which runs work."""
    ray_lease_s: Annotated[float, Field(ge=1, le=600)] = 15.0
    """Silence after which a node counts as lost and its runs are resumed elsewhere, s."""


def read_settings() -> RaySettings:
    """The settings of this process.

    Raises:
      ConfigError: one is wrong; its field is the variable.
    """
    try:
        return RaySettings()
    except ValidationError as error:
        first = field_error(error.errors()[0])
        raise ConfigError(variable(first.field), first.got, first.expected) from error


def variable(name: str) -> str:
    """The environment variable of a setting."""
    return f"RISK_SAC_{name.upper()}"


ADDRESS = variable("ray_address")
