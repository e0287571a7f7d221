"""Loads a network in libsumo, with limits on the process."""

import gc
import hashlib
import json
import os
import resource
import signal
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.maps.convert import FILE_BYTES, MEMORY_BYTES, Converted, limit, present_net, remarks
from risk_sac.maps.documents import MAX_ROADS
from risk_sac.world.net import net_remarks, summary
from risk_sac.world.read_net import parse_net, read_tree
from service.errors import UploadError
from service.networks.schemas import (
    CPU_S,
    LOG_BYTES,
    OPEN_FILES,
    STEP_S,
    STEPS,
    WALL_S,
    CheckReport,
    DocumentKind,
    NetworkFile,
)

LOG = Path("log")  # file that the file descriptors 1 and 2 write to
_FLAGS: Mapping[DocumentKind, str] = {DocumentKind.NET: "-n", DocumentKind.ADDITIONAL: "-a", DocumentKind.ROUTES: "-r"}
_OPTIONS = (
    "--xml-validation never --xml-validation.net never --xml-validation.routes never --route-steps 0 "
    f"--step-length {STEP_S} --scale 0 --no-step-log --duration-log.disable"  # flows insert nothing
).split()


def load(names: Mapping[DocumentKind, Sequence[str]]) -> list[str]:
    """Loads files of the current folder and runs a few steps silently.

    Returns what SUMO warned of; an UploadError has SUMO's own message.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # libsumo imports numpy, which reserves memory for each thread
    import libsumo  # here, so that most uploads are refused without it

    command = ["sumo", *_OPTIONS]
    for kind, flag in _FLAGS.items():
        command += [flag, ",".join(names[kind])] if names[kind] else []
    try:
        libsumo.start(command)
        for _ in range(STEPS):
            libsumo.simulationStep()
    except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
        raise UploadError(f"the simulator cannot load it: {'; '.join(_said('Error')[:5]) or error}") from error
    return _said("Warning")


def bind() -> None:
    """Bound what this process may use, for good."""
    signal.alarm(WALL_S)  # in case the server dies
    limit(resource.RLIMIT_CORE, 0)
    limit(resource.RLIMIT_CPU, CPU_S)
    limit(resource.RLIMIT_AS, MEMORY_BYTES)
    limit(resource.RLIMIT_NOFILE, OPEN_FILES)
    limit(resource.RLIMIT_FSIZE, FILE_BYTES)


def bind_simulator() -> None:
    """Denies the simulator output files, and further processes or threads unless root."""
    limit(resource.RLIMIT_FSIZE, LOG_BYTES)
    limit(resource.RLIMIT_NPROC, 0)


def _said(severity: str) -> list[str]:
    """SUMO's messages of a severity, `Error` or `Warning`, so far."""
    return remarks(LOG.read_text("utf-8", "replace"), severity)


UPLOAD = Path("upload")
MOST_WARNINGS = 20


def check(upload: Path) -> CheckReport:
    """Checks an upload: rewrites its documents, reads its net, loads all."""
    with tempfile.TemporaryDirectory(dir=".") as scratch:
        converted = present_net(upload, Path(scratch), "the upload")
        root = read_tree(converted.file)
        files = list(_kept(converted, sum(1 for _ in root.iter())))
    net = parse_net(root)
    if not net.edges:
        raise UploadError("the net has no edge outside junctions; wanted roads")
    if len(net.edges) > MAX_ROADS:
        raise UploadError(f"the net has {len(net.edges)} edges; wanted at most {MAX_ROADS}: cut the map")
    net_summary, remarks = summary(net), net_remarks(net)
    del root, net  # makes room for the simulator's
    bind_simulator()
    said = load({kind: [file.name for file in files if file.kind is kind] for kind in DocumentKind})
    warnings = (*remarks, *converted.warnings, *said)
    return CheckReport(summary=net_summary, files=tuple(files), warnings=warnings[:MOST_WARNINGS])


def _kept(converted: Converted, elements: int) -> Iterator[NetworkFile]:
    """Moves the documents to the current folder, the net first."""
    yield _moved(converted.file, "net.xml", DocumentKind.NET, elements)
    for number, document in enumerate(converted.others, start=1):
        kind = DocumentKind(document.root)
        yield _moved(document.file, f"{kind}-{number}.xml", kind, document.elements)


def _moved(file: Path, name: str, kind: DocumentKind, elements: int) -> NetworkFile:
    content = file.rename(name).read_bytes()
    return NetworkFile(name, kind, len(content), elements, hashlib.sha256(content).hexdigest())


def main() -> None:
    """Check the upload and write the report."""
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
