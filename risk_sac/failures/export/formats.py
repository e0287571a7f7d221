"""Writes exports: XML, its JSON, and a file or folder, atomically."""

import io
import json
import shutil
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import numpy as np

from risk_sac.errors import ConfigError
from risk_sac.failures.export.recorded import Recorded
from risk_sac.run_folder.durable import replace_file

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
    """Raises a `ConfigError` if a format cannot hold this or lacks packages."""
    format_ = FORMATS[name]
    if format_.of != of:
        lacks = "no single failure" if of == "failure" else "no episodes of runs"
        wanted = ", ".join(names(of))
        raise ConfigError("format", f"{name.value!r}, which holds {lacks}", f"one of: {wanted}")
    if format_.missing:
        got = f"{name}, which needs {', '.join(format_.missing)}, and that is not installed"
        raise ConfigError("format", got, remedy=REMEDY)


def export(name: FormatName, source: Recorded | Sequence[Path]) -> Files:
    """Exports a failure, or all episodes of the runs in some folders.

    Raises:
      ConfigError: the format holds no such thing, lacks a package, or cannot hold this failure; or no run is there.
      SimulationError: the format plays the failure again, and it does not repeat here.
    """
    check_carries(name, "episodes" if isinstance(source, Sequence) else "failure")
    files: Files = import_module(f"risk_sac.failures.export.{name}").files(source)
    return files


BESIDE = "beside.json"  # its name, which the files that it lies beside have in them
PER_OTHER = ("visible", "distance_m", "ttc_s", "rss_longitudinal_m", "rss_lateral_m")
BEGINNING = (1980, 1, 1, 0, 0, 0)  # of a zip's calendar: the same export is the same file


def document(root: ET.Element) -> bytes:
    """Returns the whole text, indented; the same element gives the same bytes."""
    ET.indent(root)
    content: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return content + b"\n"


def add(parent: ET.Element, name: str, text: object = "", /, **attributes: object) -> ET.Element:
    """Adds an element; a number as its text has six decimals."""
    child = ET.SubElement(parent, name, {key: str(each) for key, each in attributes.items()})
    child.text = f"{text:.6f}" if isinstance(text, float) else str(text)
    return child


def beside(failure: Recorded, lacks: tuple[str, ...]) -> bytes:
    """Returns the JSON of what the format cannot carry (`lacks`, in words)."""
    manifest, series = failure.manifest, failure.series
    ids = [actor.id for actor in failure.actors]
    told = {
        "failure": failure.name,
        "not_in_the_format": lacks,
        "first_frame_s": 0.0,
        "released_s": failure.released_s,
        "run": manifest.spec.model_dump(mode="json"),
        "odd": failure.problem.odd.model_dump(mode="json"),
        "requirements": [requirement.model_dump(mode="json") for requirement in failure.problem.requirements],
        "episode": manifest.episode.model_dump(mode="json"),
        "friction": failure.layout.friction,
        "roles": {actor.id: actor.role.name.lower() for actor in failure.actors},
        "time_s": failure.time_s,
        "robustness": {str(name): series["robustness"][:, i] for i, name in enumerate(series["requirements"])},
        "soft_min": series["soft_min"],
        "to_the_ego": {
            name: {id_: series[name][:, column] for column, id_ in enumerate(ids) if column} for name in PER_OTHER
        },
        "signals": {id_: [bytes(row).decode() for row in rows] for id_, rows in failure.heads.items()},
        "trajectory_digest": manifest.digest,
        "versions": dict(manifest.versions),
        "code": manifest.code,
        "world": dict(manifest.world),
    }
    return json.dumps(_plain(told), allow_nan=False).encode()


def _plain(value: Any) -> Any:
    """Converts to JSON's types; a number that is not finite is null."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return [round(float(item), 6) if np.isfinite(item) else None for item in value]
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def packed(format_: Format, files: Files) -> bytes:
    """Returns what is downloaded: the one file, or a zip of several."""
    if format_.media_type != ZIP:
        (content,) = files.values()
        return content
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, BEGINNING), content, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def write(format_: Format, files: Files, out: Path) -> None:
    """Writes an export into one file or a new folder.

    It is a folder if there are several files and `out` names no zip.

    Raises:
      ConfigError: the folder is there and not empty.
      OSError: the disk refuses it; then nothing of it is left.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    if format_.media_type != ZIP or out.suffix == ".zip":
        replace_file(out, packed(format_, files))
        return
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ConfigError("--out", f"{out}, which exists", "a new folder, an empty one, or a name that ends in .zip")
    draft = out.with_name(f".{out.name}.tmp")
    shutil.rmtree(draft, ignore_errors=True)  # of one that was killed
    try:
        draft.mkdir()
        for name, content in files.items():
            replace_file(draft / name, content)
        draft.replace(out)
    except OSError:
        shutil.rmtree(draft, ignore_errors=True)
        raise
