"""Converts maps of other formats and older SUMO nets by SUMO's netconvert.

netconvert comes with the package `eclipse-sumo`, not with `libsumo`; on a machine without it, only nets of the present
format can be read.
"""

import importlib.util
import os
import re
import resource
import shutil
import signal
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.maps.documents import MAP_ROOTS, MAX_BYTES, SMALLER, Document, rewritten
from risk_sac.maps.opendrive import crossing_options, find_crosswalks, ready, sidewalk_options
from risk_sac.world.read_net import parse_net, read_tree

PRESENT = (1, 16)  # nets since then say all that is read
WALL_S = 120
MEMORY_BYTES = 4 << 30  # of address space; Python with an idle libsumo takes 0.9 GiB
FILE_BYTES = 2 * MAX_BYTES  # what is written again has more end tags
MOST_REMARKS = 20
_LONGEST = 300
_OSM = (
    "--geometry.remove --ramps.guess --junctions.join --tls.guess-signals --tls.discard-simple --tls.join "
    "--tls.default-type static --sidewalks.guess --crossings.guess --walkingareas --no-turnarounds "
    "--output.street-names --osm-files"
)
_OPENDRIVE = "--tls.default-type static --no-turnarounds --output.original-names --opendrive-files"
OPTIONS: dict[str, list[str]] = {  # by the root of a map
    "net": ["--sumo-net-file"],
    "osm": _OSM.split(),
    "OpenDRIVE": _OPENDRIVE.split(),
}


@dataclass(frozen=True, slots=True)
class Converted:
    """Readable net, with the warnings of its conversion and other documents."""

    file: Path
    warnings: tuple[str, ...]
    others: tuple[Document, ...] = ()


def present_net(file: Path, folder: Path, name: str = "") -> Converted:
    """Writes the map as a net of the present format into `folder`.

    It may be a net, an OSM extract or OpenDRIVE, plain, in gzip, or in a zip archive; its content tells, not its name.
    Messages call it `name`, or else by its file.

    Raises:
      MapError: it is none of them, or has left-hand traffic, or netconvert refuses it or is not there.
    """
    name = name or file.name
    documents = rewritten(file, folder, name)
    maps = [document for document in documents if document.root in MAP_ROOTS]
    if len(maps) != 1:
        raise MapError("network", f"{name} with {len(maps)} maps", "one")
    (map_,) = maps
    others = tuple(document for document in documents if document is not map_)
    left_out = [remark for document in documents for remark in document.remarks]
    if map_.root == "net" and _version(map_.attributes) >= PRESENT:
        return Converted(map_.file, tuple(left_out), others)
    net = folder / "converted.net.xml"
    if map_.root == "OpenDRIVE":
        return Converted(net, (*left_out, *_from_opendrive(map_, net, name)), others)
    output = _convert(map_, net, name)
    return Converted(net, (*left_out, *remarks(output, "Warning")), others)


def _from_opendrive(map_: Document, net: Path, name: str) -> list[str]:
    """Converts roads and crosswalks of OpenDRIVE; returns remarks."""
    folder, walks = net.parent, find_crosswalks(map_.file)
    readied = replace(map_, file=folder / "readied.xml")
    lost = ready(map_.file, readied.file, walks)
    if not walks.count:
        return [*lost, *remarks(_convert(readied, net, name, ["--geometry.remove"]), "Warning")]
    options = sidewalk_options(Path(netconvert()[1]["SUMO_HOME"]) / "data" / "typemap", folder)
    _convert(readied, net, name, options)
    options += crossing_options(walks, parse_net(read_tree(net)), folder)
    output = _convert(readied, net, name, [*options, "--geometry.remove"])
    if missing := walks.count - len(parse_net(read_tree(net)).crossings):
        lost.append(f"left out, because netconvert builds no crossings there: crosswalks ({missing})")
    return [*lost, *remarks(output, "Warning")]


def remarks(output: str, severity: str) -> list[str]:
    """Returns SUMO's first messages of severity `Error` or `Warning`, shortened."""
    found = re.findall(rf"^{severity}: (.*)$", output, re.MULTILINE)
    return ["".join(filter(str.isprintable, line))[:_LONGEST] for line in found[:MOST_REMARKS]]


def limit(resource_: int, most: int, pid: int = 0) -> None:
    """Lowers a process's limit for good, by default this process's."""
    most = min([most, *(bound for bound in resource.prlimit(pid, resource_) if bound != resource.RLIM_INFINITY)])
    resource.prlimit(pid, resource_, (most, most))


def netconvert() -> tuple[str, dict[str, str]]:
    """Finds the netconvert program and its environment; raises `MapError` if missing."""
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


def _version(attributes: Mapping[str, str]) -> tuple[int, ...]:
    version = re.match(r"(\d+)\.(\d+)", attributes.get("version", ""))
    return (int(version[1]), int(version[2])) if version else (0,)


def _convert(map_: Document, net: Path, name: str, options: Sequence[str] = ()) -> str:
    """Runs netconvert within limits in its files' folder; returns its messages.

    A comma in a path would make a list.
    """
    program, environment = netconvert()
    files = [map_.file.name, "--output-file", net.name, "--xml-validation", "never"]
    command = [program, *options, *OPTIONS[map_.root], *files]
    log = net.with_suffix(".log")
    with log.open("wb") as stream:
        process = subprocess.Popen(command, cwd=net.parent, env=environment, stdout=subprocess.DEVNULL, stderr=stream)
    with process:
        try:
            _bind(process.pid)
            status = process.wait(WALL_S)
        except subprocess.TimeoutExpired:
            raise MapError("network", f"{name}, which takes more than {WALL_S} s to convert", remedy=SMALLER) from None
        finally:
            process.kill()  # whatever ended the wait
    output = log.read_text("utf-8", "replace")
    if status < 0 or "bad_alloc" in output:
        raise _crash(status, output, name)
    if status != 0:
        why = "; ".join(remarks(output, "Error")[:5]) or f"status {status}"
        raise MapError("network", f"netconvert cannot convert {name}: {why}")
    return output


def _bind(pid: int) -> None:
    """Limits what a process may use; one that has ended uses nothing."""
    limit(resource.RLIMIT_CORE, 0, pid)
    limit(resource.RLIMIT_AS, MEMORY_BYTES, pid)
    limit(resource.RLIMIT_FSIZE, FILE_BYTES, pid)


def _crash(status: int, output: str, name: str) -> MapError:
    if "bad_alloc" in output or -status in (signal.SIGXCPU, signal.SIGXFSZ, signal.SIGKILL):
        got = f"{name}, for which netconvert has too little time or memory"
        return MapError("network", got, f"one that takes at most {WALL_S} s and {MEMORY_BYTES >> 20} MiB", SMALLER)
    last = next(iter(remarks(output, "Error") or remarks(output, "Warning")[::-1]), "nothing")
    return MapError(
        "network",
        f"SUMO's netconvert crashes on {name} ({signal.Signals(-status).name}); it said last: {last}",
        remedy="open the map in SUMO's netedit, repair or remove what it cannot read, and send what netedit saves",
    )
