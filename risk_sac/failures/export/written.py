"""Writes exports: XML, the JSON beside them, and one file or one folder, whole or not at all."""

import io
import json
import shutil
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from risk_sac.errors import ConfigError
from risk_sac.failures.export.formats import ZIP, Files, Format
from risk_sac.failures.export.recorded import Recorded
from risk_sac.run_folder.durable import replace_file

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
    """Returns the JSON of what the format cannot carry, which `lacks` says in words."""
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
