"""From an upload to a report: read, write anew, load."""

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from service.errors import UploadError
from service.networks.checker import simulator
from service.networks.checker.archive import documents
from service.networks.checker.document import Observer, read, root_of
from service.networks.checker.roads import Demand, Net
from service.networks.report import CheckReport, Kind, NetworkFile, Packaging, Summary

FOREIGN = ("osm", "OpenDRIVE")  # roots of maps that are converted
MOST_WARNINGS = 20


def check(upload: Path, packaging: Packaging) -> CheckReport:
    """Reads the upload, writes anew what it says, and lets the simulator load that."""
    found, remarks = _converted(documents(upload, packaging))
    files, summary, more = rewrite(found)
    simulator.bind_simulator()
    names = {kind: [file.name for file in files if file.kind is kind] for kind in Kind}
    warnings = simulator.load(names[Kind.NET][0], names[Kind.ADDITIONAL], names[Kind.ROUTES])
    return CheckReport(summary=summary, files=tuple(files), warnings=(*more, *remarks, *warnings)[:MOST_WARNINGS])


def _converted(found: Sequence[bytes]) -> tuple[Sequence[bytes], list[str]]:
    """The documents as nets: a map in another format, alone in its upload, is converted."""
    with _naming(0, "unknown"):
        root = root_of(found[0]) if found else ""
    if root not in FOREIGN:
        return found, []
    if len(found) > 1:
        raise UploadError(f"file 0 is <{root}> and there are {len(found)} files; wanted a map to convert alone")
    from service.networks.checker.foreign import converted  # here, because most uploads are nets

    with _naming(0, root):
        net, remarks = converted(found[0], root)
    return [net], remarks


def rewrite(found: Sequence[bytes]) -> tuple[list[NetworkFile], Summary, list[str]]:
    """Writes each document anew in the current folder, under a name of ours, the net first; its remarks are last."""
    kinds = [_kind(number, data) for number, data in enumerate(found)]
    if kinds.count(Kind.NET) != 1:
        raise UploadError(f"there are {kinds.count(Kind.NET)} nets in the upload; wanted one")
    net = Net()
    first = kinds.index(Kind.NET)
    files = [_rewrite_one(first, Kind.NET, found[first], net)]
    summary = net.finish()
    demand = Demand(net)
    for number, (kind, data) in enumerate(zip(kinds, found, strict=True)):
        if number != first:
            files.append(_rewrite_one(number, kind, data, demand, sum(file.elements for file in files)))
    return files, summary, net.remarks()


def _kind(number: int, data: bytes) -> Kind:
    with _naming(number, "unknown"):
        root = root_of(data)
        if root not in list(Kind):
            raise UploadError(
                f"its root is <{root[:80]}>; wanted <net>, <routes> or <additional>; or <osm> or <OpenDRIVE>, alone"
            )
        return Kind(root)


def _rewrite_one(number: int, kind: Kind, data: bytes, observer: Observer, before: int = 0) -> NetworkFile:
    with _naming(number, kind):
        document = read(data, kind, observer, before)
    text = document.text.encode()
    name = f"{kind}.xml" if kind is Kind.NET else f"{kind}-{number}.xml"
    Path(name).write_bytes(text)
    return NetworkFile(name, kind, len(text), document.elements, hashlib.sha256(text).hexdigest())


@contextmanager
def _naming(number: int, kind: str) -> Iterator[None]:
    try:
        yield
    except UploadError as error:
        raise UploadError(f"file {number} ({kind}): {error}") from error
