"""Maps in other formats, and SUMO's from earlier versions, become nets by SUMO's own netconvert.

netconvert comes with the package `eclipse-sumo`, not with `libsumo`; on a machine without it, only nets of the present
format can be read.
"""

import gzip
import importlib.util
import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.scenario.maps.sides import side_remarks

PRESENT = (1, 16)  # nets since then say all that is read
HEAD_BYTES = 4096
WALL_S = 120
MOST_REMARKS = 20
_LONGEST = 300


class Format(StrEnum):
    """What a map is written in."""

    NET = "net"
    OSM = "osm"
    OPENDRIVE = "OpenDRIVE"


_OSM = (
    "--geometry.remove --ramps.guess --junctions.join --tls.guess-signals --tls.discard-simple --tls.join "
    "--tls.default-type static --sidewalks.guess --crossings.guess --walkingareas --no-turnarounds "
    "--remove-edges.isolated --output.street-names --osm-files"
)
_OPENDRIVE = "--geometry.remove --tls.default-type static --no-turnarounds --opendrive-files"
OPTIONS: dict[Format, tuple[str, ...]] = {
    Format.NET: ("--sumo-net-file",),
    Format.OSM: tuple(_OSM.split()),
    Format.OPENDRIVE: tuple(_OPENDRIVE.split()),
}
ROOTS = {"net": Format.NET, "osm": Format.OSM, "OpenDRIVE": Format.OPENDRIVE}


@dataclass(frozen=True, slots=True)
class Converted:
    """A net that can be read, and what was remarked on the way to it."""

    file: Path
    warnings: tuple[str, ...]


def present_net(file: Path, folder: Path) -> Converted:
    """The map as a net of the present format: itself, where it is one, or a file in `folder`.

    It may be a net, an OSM extract or OpenDRIVE, gzipped or not; its content tells, not its name.

    Raises:
      MapError: it is none of them, or has left-hand traffic, or netconvert refuses it or is not there.
    """
    plain = _unpacked(file, folder)
    format_, version = _told(plain)
    if format_ is Format.NET and version >= PRESENT:
        return Converted(plain, ())
    out = folder / "converted.net.xml"
    sides = side_remarks(plain) if format_ is not Format.NET else []
    said = _run(format_, plain, out, file.name)
    return Converted(out, (*sides, *remarks(said, "Warning")))


def conversion(format_: Format, source: str, target: str) -> list[str]:
    """Netconvert's arguments."""
    return [*OPTIONS[format_], source, "--output-file", target]


def remarks(said: str, severity: str) -> list[str]:
    """Netconvert's messages of a severity, `Error` or `Warning`; the first ones, shortened."""
    found = re.findall(rf"^{severity}: (.*)$", said, re.MULTILINE)
    return ["".join(filter(str.isprintable, line))[:_LONGEST] for line in found[:MOST_REMARKS]]


def netconvert() -> tuple[str, dict[str, str]]:
    """The program, and the environment in which it finds its own files; raises `MapError` if it is not installed."""
    package = importlib.util.find_spec("sumo")
    for home in package.submodule_search_locations or () if package else ():
        if program := shutil.which("netconvert", path=str(Path(home) / "bin")):
            return program, _environment(home)
    if program := shutil.which("netconvert"):
        return program, _environment(os.environ.get("SUMO_HOME", "/usr/share/sumo"))
    raise MapError(
        "network", "a map that netconvert converts, and that is not installed", remedy="pip install eclipse-sumo"
    )


def _environment(home: str) -> dict[str, str]:
    return {"PATH": os.defpath, "SUMO_HOME": home, "PROJ_LIB": f"{home}/data/proj", "PROJ_DATA": f"{home}/data/proj"}


def _unpacked(file: Path, folder: Path) -> Path:
    with file.open("rb") as stream:
        packed = stream.read(2) == b"\x1f\x8b"
    if not packed:
        return file
    plain = folder / "unpacked.xml"
    try:
        with gzip.open(file) as source, plain.open("wb") as target:
            shutil.copyfileobj(source, target)
    except (EOFError, gzip.BadGzipFile) as error:
        raise MapError("network", f"{file.name} is no whole gzip file: {error}") from error
    return plain


def _told(file: Path) -> tuple[Format, tuple[int, ...]]:
    """Format and version, by the root element."""
    with file.open("rb") as stream:
        head = stream.read(HEAD_BYTES).decode("utf-8", "replace")
        # Netconvert writes a long comment first.
        while "-->" not in head and "<!--" in head and (more := stream.read(HEAD_BYTES)):
            head += more.decode("utf-8", "replace")
        head += stream.read(HEAD_BYTES).decode("utf-8", "replace")
    root = re.search(r"<([A-Za-z_][\w.-]*)([^>]*)", re.sub(r"<!--.*?-->", "", head, flags=re.DOTALL))
    if root is None or root[1] not in ROOTS:
        got = "no XML" if root is None else f"XML with the root <{root[1][:40]}>"
        raise MapError("network", f"{file.name}, which is {got}", "<net> (SUMO), <osm> or <OpenDRIVE>")
    version = re.search(r'version="(\d+)\.(\d+)', root[2])
    return ROOTS[root[1]], (0,) if version is None else (int(version[1]), int(version[2]))


def _run(format_: Format, plain: Path, out: Path, name: str) -> str:
    """What netconvert says."""
    program, environment = netconvert()
    command = [program, *conversion(format_, str(plain), str(out))]
    try:
        done = subprocess.run(command, capture_output=True, timeout=WALL_S, env=environment, check=False)
    except subprocess.TimeoutExpired:
        raise MapError("network", f"{name}, which takes more than {WALL_S} s to convert", "a smaller map") from None
    said = done.stderr.decode("utf-8", "replace")
    if done.returncode != 0:
        why = "; ".join(remarks(said, "Error")[:5]) or f"status {done.returncode}"
        raise MapError("network", f"netconvert cannot convert {name}: {why}")
    return said
