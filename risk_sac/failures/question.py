"""What can be asked of a failure by whoever must not load the simulator; see `risk_sac.failures.study`."""

from pathlib import Path
from typing import Literal

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.failures.export.formats import FormatName
from risk_sac.records import EpisodeRecord, Record

IDLE = "idle"
Twin = Literal["idle", "default", "perfect", "careful"]
"""What may be changed in a scene's twin: nobody attacks, or the profile of another ego."""
Subject = Literal["bundle", "core", "region", "twin", "export"]
REFUSED = 3  # exit status; the answer is why, in words


class Question(Record):
    """What is asked of which failure."""

    subject: Subject
    spec: RunSpec
    episode: EpisodeRecord
    series: Path
    """File of its time series."""
    twin: EgoConfig | None = None
    """The other ego of a twin; null: nobody attacks."""
    format: FormatName | None = None
    """Of an export, which."""
