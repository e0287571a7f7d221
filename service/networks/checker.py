"""`service.networks.checker REPORT`: check the file `upload` in the current folder.

Started by `service.networks.sandbox`, which never reads an upload itself. Whatever goes wrong here, by a bug of ours
or of the simulator's, ends this process and nothing else. What passes is written again beside the upload.
"""

import gc
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.scenario.maps.convert import MEMORY_BYTES, Converted, present_net
from risk_sac.scenario.maps.documents import MAX_ROADS
from risk_sac.scenario.maps.read_net import parse_net, read_tree
from risk_sac.scenario.maps.summary import net_remarks, summary
from service.errors import UploadError
from service.networks.report import CheckReport, Kind, NetworkFile
from service.networks.simulator import bind, bind_simulator, load

UPLOAD = Path("upload")
MOST_WARNINGS = 20


def check(upload: Path) -> CheckReport:
    """Rewrites the documents of an upload, reads the net, and loads all in the simulator."""
    with tempfile.TemporaryDirectory(dir=".") as scratch:
        converted = present_net(upload, Path(scratch), "the upload")
        root = read_tree(converted.file)
        files = list(_kept(converted, sum(1 for _ in root.iter())))
    net = parse_net(root)
    if not net.edges:
        raise UploadError("the net has no edge outside junctions; wanted roads")
    if len(net.edges) > MAX_ROADS:
        raise UploadError(f"the net has {len(net.edges)} edges; wanted at most {MAX_ROADS}: cut the map")
    found, remarks = summary(net), net_remarks(net)
    del root, net  # makes room for the simulator's
    bind_simulator()
    said = load({kind: [file.name for file in files if file.kind is kind] for kind in Kind})
    warnings = (*remarks, *converted.warnings, *said)
    return CheckReport(summary=found, files=tuple(files), warnings=warnings[:MOST_WARNINGS])


def _kept(converted: Converted, elements: int) -> Iterator[NetworkFile]:
    """Moves the documents to the current folder, the net first."""
    yield _moved(converted.file, "net.xml", Kind.NET, elements)
    for number, document in enumerate(converted.others, start=1):
        kind = Kind(document.root)
        yield _moved(document.file, f"{kind}-{number}.xml", kind, document.elements)


def _moved(file: Path, name: str, kind: Kind, elements: int) -> NetworkFile:
    content = file.rename(name).read_bytes()
    return NetworkFile(name, kind, len(content), elements, hashlib.sha256(content).hexdigest())


def main() -> None:
    """Check the upload and say what came of it."""
    gc.disable()  # no cycles arise, and looking for them takes a sixth of the time
    bind()
    try:
        report = check(UPLOAD)
    except MapError as error:
        report = CheckReport(refused=str(error).removeprefix("network: "))
    except UploadError as error:
        report = CheckReport(refused=str(error))
    except MemoryError:
        report = CheckReport(refused=f"checking it needs more than {MEMORY_BYTES >> 20} MiB; wanted a smaller network")
    Path(sys.argv[1]).write_text(json.dumps(asdict(report)))
    os._exit(0)  # without the simulator's own clean-up, which may crash


if __name__ == "__main__":
    main()
