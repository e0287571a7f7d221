"""Roads of a scenario: OpenDRIVE files, and the SUMO nets that they are converted to."""

import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from risk_sac.config.base import Chosen
from risk_sac.errors import ConfigError
from risk_sac.maps.convert import present_net
from risk_sac.maps.documents import MAX_BYTES
from risk_sac.openscenario.scope import At, Text
from risk_sac.openscenario.sources import SourceFiles

MOST_ROADS = 20
_NET, _ROAD = ".net.xml", ".xodr"


@dataclass
class RoadFiles:
    """Nets and road files of a document, by name."""

    network: Text
    road: Text
    files: dict[str, bytes] = field(default_factory=dict)


def missing(at: At, text: Text, sources: SourceFiles, file: Path) -> list[str]:
    """Returns the road files of a parameter's words that are not there; raises `ConfigError` if none is."""
    if not isinstance(text, Chosen):
        sources.find(text, file, at.element)
        return []
    absent, last = list[str](), None
    for name in dict.fromkeys(text.of.values()):
        try:
            sources.find(name, file, at.element)
        except ConfigError as error:
            absent.append(name)
            last = error
    if last is not None and len(absent) == len(set(text.of.values())):
        raise last
    return absent


def converted(at: At, text: Text, sources: SourceFiles, file: Path, remarks: list[str]) -> RoadFiles:
    """Converts all roads that a scenario may be on.

    Args:
      at: the element that names them.
      text: their names.
      sources: reads files.
      file: the scenario file.
      remarks: to which what a road loses is added.

    Raises:
      ConfigError: a road is not there, is no OpenDRIVE, or cannot be converted.
    """
    names = dict.fromkeys([text] if isinstance(text, str) else text.of.values())
    if len(names) > MOST_ROADS:
        raise at.refusal(f"{len(names)} roads", f"at most {MOST_ROADS}")
    stems, files = dict[str, str](), dict[str, bytes]()
    for name in names:
        path = sources.find(name, file, at.element)
        content = sources.content(path, at.element.place)
        if len(content) > MAX_BYTES or b"<OpenDRIVE" not in content:
            raise at.refusal(f"{name!r}, which is no OpenDRIVE", "an OpenDRIVE file (.xodr)")
        stems[name] = _free_stem(path.stem, files)
        files[stems[name] + _ROAD] = content
        files[stems[name] + _NET] = _net(at, path, remarks)
    if isinstance(text, str):
        return RoadFiles(stems[text] + _NET, stems[text] + _ROAD, files)
    return RoadFiles(_chosen(text, stems, _NET), _chosen(text, stems, _ROAD), files)


def _chosen(text: Chosen[str], stems: Mapping[str, str], ending: str) -> Chosen[str]:
    return Chosen[str](by=text.by, of={word: stems[name] + ending for word, name in text.of.items()})


def _free_stem(stem: str, files: Mapping[str, bytes]) -> str:
    plain = re.sub(r"[^A-Za-z0-9_-]", "_", stem)[:60] or "road"
    while plain + _ROAD in files:
        plain += "_"
    return plain


def _net(at: At, path: Path, remarks: list[str]) -> bytes:
    with tempfile.TemporaryDirectory(prefix="risk-sac-") as folder:
        try:
            net = present_net(path, Path(folder), path.name)
        except ConfigError as error:
            raise at.refusal(f"{path.name}: {error.got}", error.expected, error.remedy) from error
        remarks += [f"{path.name}: {warning}" for warning in net.warnings]
        return re.sub(rb"<!--.*?-->\s*", b"", net.file.read_bytes(), count=1, flags=re.DOTALL)  # it has the time
