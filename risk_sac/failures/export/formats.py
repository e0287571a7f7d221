"""Table of the export formats.

The module of a format has its name and a function `files`; it and its packages are imported when an export is made.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from risk_sac.errors import ConfigError

if TYPE_CHECKING:
    from risk_sac.failures.export.recorded import Recorded

REMEDY = "pip install 'risk-sac[export]' brings it"
ZIP = "application/zip"
Files = Mapping[str, bytes]
"""Files of an export: name → content."""


class FormatName(StrEnum):
    """Name of a format on the command line and over REST."""

    SUMO = "sumo"
    OPENSCENARIO = "openscenario"
    COMMONROAD = "commonroad"
    MCAP = "mcap"
    GIF = "gif"
    PARQUET = "parquet"


@dataclass(frozen=True, slots=True)
class Format:
    """One row of the table."""

    title: str  # in a menu
    what: str  # in one sentence
    packages: tuple[str, ...] = ()  # that it imports besides those of risk-sac
    suffix: str = ".zip"  # of what is downloaded: several files, or the one that it is
    media_type: str = ZIP
    of: Literal["failure", "episodes"] = "failure"  # one failure, or all episodes of runs

    @property
    def missing(self) -> tuple[str, ...]:
        """Its packages that are not installed."""
        return tuple(name for name in self.packages if find_spec(name) is None)


FORMATS: Mapping[FormatName, Format] = {
    FormatName.SUMO: Format(
        "SUMO", "net, vehicle types and a TraCI script that replays it in sumo or sumo-gui, and its FCD"
    ),
    FormatName.OPENSCENARIO: Format(
        "OpenSCENARIO",
        "OpenSCENARIO XML 1.2 on an OpenDRIVE 1.7 road, signals included; the ego is free, or drives as recorded",
        packages=("scenariogeneration",),
    ),
    FormatName.COMMONROAD: Format(
        "CommonRoad", "CommonRoad XML 2020a with a planning problem for the ego, or with the ego as recorded"
    ),
    FormatName.MCAP: Format(
        "MCAP",
        "a recording with foxglove schemas: roads, bodies, signals, distances, requirements",
        ("foxglove",),
        ".mcap",
        "application/octet-stream",
    ),
    FormatName.GIF: Format("GIF", "an animation of the last seconds, seen from above", (), ".gif", "image/gif"),
    FormatName.PARQUET: Format(
        "Parquet",
        "a table with a row for every episode of the runs, whatever its outcome",
        ("pyarrow",),
        ".parquet",
        "application/vnd.apache.parquet",
        of="episodes",
    ),
}


def names(of: Literal["failure", "episodes"]) -> list[FormatName]:
    """Returns the formats that hold one failure, or all episodes."""
    return [name for name, format_ in FORMATS.items() if format_.of == of]


def check_carries(name: FormatName, of: Literal["failure", "episodes"]) -> None:
    """Raises a ConfigError for a format that cannot hold this, or that lacks a package."""
    format_ = FORMATS[name]
    if format_.of != of:
        lacks = "no single failure" if of == "failure" else "no episodes of runs"
        wanted = ", ".join(names(of))
        raise ConfigError("format", f"{name.value!r}, which holds {lacks}", f"one of: {wanted}")
    if format_.missing:
        got = f"{name}, which needs {', '.join(format_.missing)}, and that is not installed"
        raise ConfigError("format", got, remedy=REMEDY)


def export(name: FormatName, source: "Recorded | Sequence[Path]") -> Files:
    """Exports a failure, or all episodes of the runs in some folders.

    Raises:
      ConfigError: the format holds no such thing, lacks a package, or cannot hold this failure; or no run is there.
      SimulationError: the format plays the failure again, and it does not repeat here.
    """
    check_carries(name, "episodes" if isinstance(source, Sequence) else "failure")
    files: Files = import_module(f"risk_sac.failures.export.{name}").files(source)
    return files
