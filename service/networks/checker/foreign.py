"""Maps in other formats: written anew without what could harm, and made a net by netconvert.

netconvert is started from here, so it is bound as this process is: in memory, in time, in what it writes and opens. It
sees no document type, no included file and no option but ours, and what it makes is checked as any net.
"""

import re
import subprocess
from pathlib import Path
from xml.sax.saxutils import quoteattr

from risk_sac.errors import MapError
from risk_sac.scenario.maps.convert import Format, conversion, netconvert, remarks
from risk_sac.scenario.maps.sides import side_remarks
from service.errors import UploadError
from service.networks.checker.document import parse
from service.networks.limits import MAX_FOREIGN_DEPTH, MAX_FOREIGN_ELEMENTS, MAX_VALUE, WALL_S

FORMATS = {"osm": Format.OSM, "OpenDRIVE": Format.OPENDRIVE}
NOTES = re.compile(rb"<param [^>]*/>")  # where netconvert has something from; of a signal, the checker takes none
MAP, CONVERTED = "map.xml", "converted.net.xml"
# What netconvert does not need: other files, text, and projections that name files.
LEFT_OUT = frozenset(("include", "userData", "dataQuality", "geoReference", "offset", "license"))


class _Map:
    """The target that the parser tells what it finds; what is left out, is so with all that it holds."""

    def __init__(self) -> None:
        self.parts = ['<?xml version="1.0" encoding="UTF-8"?>\n']
        self._elements = self._depth = self._ignored = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self._elements += 1
        self._depth += 1
        if self._elements > MAX_FOREIGN_ELEMENTS:
            raise UploadError(f"there are more than {MAX_FOREIGN_ELEMENTS} elements; wanted a smaller map")
        if self._depth > MAX_FOREIGN_DEPTH:
            raise UploadError(f"elements are nested more than {MAX_FOREIGN_DEPTH} deep; wanted at most that")
        if self._ignored or tag in LEFT_OUT or not tag.isidentifier():
            self._ignored += 1
            return
        kept = (f" {name}={quoteattr(value)}" for name, value in attributes.items() if _is_harmless(name, value))
        self.parts.append(f"<{tag}{''.join(kept)}>")

    def end(self, tag: str) -> None:
        self._depth -= 1
        if self._ignored:
            self._ignored -= 1
        else:
            self.parts.append(f"</{tag}>\n")

    def data(self, text: str) -> None: ...

    def close(self) -> None: ...


def converted(data: bytes, root: str) -> tuple[bytes, list[str]]:
    """Returns the net that netconvert makes of a map with this root, one of `FORMATS`, and its remarks."""
    target = _Map()
    parse(data, target)
    Path(MAP).write_text("".join(target.parts), encoding="utf-8")
    try:
        sides = side_remarks(Path(MAP))
        program, environment = netconvert()
    except MapError as error:
        raise UploadError(str(error).removeprefix(f"{error.field}: ")) from error
    command = [program, *conversion(FORMATS[root], MAP, CONVERTED), "--xml-validation", "never"]
    done = subprocess.run(command, env=environment, capture_output=True, timeout=WALL_S, check=False)
    said = done.stderr.decode("utf-8", "replace")
    if done.returncode != 0:
        why = "; ".join(remarks(said, "Error")) or f"it ended with status {done.returncode}"
        raise UploadError(f"netconvert cannot convert the map: {why}")
    net = NOTES.sub(b"", Path(CONVERTED).read_bytes())
    for name in (MAP, CONVERTED):
        Path(name).unlink()
    return net, [*sides, *remarks(said, "Warning")]


def _is_harmless(name: str, value: str) -> bool:
    return name.isidentifier() and len(value) <= MAX_VALUE and value.isprintable() and "$" not in value
