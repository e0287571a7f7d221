"""Settings of the server process, read from RISK_SAC_* environment variables."""

import os
from pathlib import Path
from typing import Annotated

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict


def _cores() -> int:
    """Cores this process may use, which inside a container are fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class ServiceSettings(BaseSettings):
    """Where the server listens, what it may use, and how patient it is."""

    model_config = SettingsConfigDict(env_prefix="RISK_SAC_", frozen=True, use_attribute_docstrings=True)

    data_dir: Path = Path("data")
    """Folder of the database, checkpoints and recorded failures."""
    host: str = "127.0.0.1"
    """Address to listen on."""
    port: Annotated[int, Field(ge=1, le=65535)] = 8000
    """TCP port to listen on."""
    max_workers: Annotated[int, Field(ge=1, le=1024)] = Field(default_factory=_cores)
    """Runs executed at the same time, each in a process of its own; by default one per core."""
    grace_s: Annotated[float, Field(gt=0, le=600)] = 30.0
    """How long a worker that was asked to stop may finish its episode before it is killed, s."""
    worker_module: str = "service.worker"
    """Module that executes one run, started as `python -m`."""

    @property
    def database(self) -> Path:
        """The SQLite file."""
        return self.data_dir / "risk-sac.db"

    def run_folder(self, campaign_id: str, run_id: str) -> Path:
        """Where one run keeps its results, its recorded failures, its checkpoint and its log."""
        return self.data_dir / "campaigns" / campaign_id / run_id
