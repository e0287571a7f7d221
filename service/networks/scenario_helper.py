"""Checks, keeps and draws scenarios in a process of its own.

`service.networks.scenarios` starts `service.networks.scenario_helper QUESTION ANSWER ACTION`:

    add EGO        checks the document, or the archive, that the question holds, keeps it, and answers with its name
    check EGO      checks it, plays 20 scenes of it, and answers with a `ScenarioCheck`
    picture NAME   answers with a PNG

EGO is the ego among the entities of OpenSCENARIO, or empty.
"""

import io
import json
import sys
import tempfile
import zipfile
from pathlib import Path

from risk_sac.config import Scenario
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.maps.convert import present_net
from risk_sac.maps.documents import MAX_BYTES, MAX_FILES
from risk_sac.openscenario.scenario_file import Imported, import_scenario
from risk_sac.openscenario.sources import holds_scenario, unpack
from risk_sac.scenario import library
from risk_sac.scenario.check import check_document
from risk_sac.scenario.reading import (
    MOST_BYTES,
    document_from,
    nets_of,
    networks,
    shipped_document,
    shipped_names,
    too_long,
)
from service.networks.schemas import SCENARIO_MEMORY_BYTES

DOCUMENT_ENDS = (".yaml", ".yml", ".json")
WANTED = "one document (.yaml or .json) and the nets that it names, or an OpenSCENARIO file with what it names"


def main() -> None:
    """Does what the arguments say, and writes the answer."""
    question, answer, action, *arguments = sys.argv[1:]
    try:
        content = (
            _picture(*arguments) if action == "picture" else _posted(Path(question).read_bytes(), action, *arguments)
        )
    except ConfigError as error:
        faults = [(fault.field, fault.got, fault.expected, fault.remedy) for fault in (error, *error.others)]
        content = json.dumps({"faults": faults}).encode()
    except DamagedError as error:
        content = json.dumps({"damaged": str(error)}).encode()
    except MemoryError:
        got = f"a scenario whose check needs more than {SCENARIO_MEMORY_BYTES >> 20} MiB"
        content = json.dumps({"faults": [("network", got, "a smaller network", "")]}).encode()
    Path(answer).write_bytes(content)


def _posted(upload: bytes, action: str, ego_entity: str) -> bytes:
    with tempfile.TemporaryDirectory() as scratch:
        folder, imported = Path(scratch), None
        if holds_scenario(upload):
            imported = _imported(upload, folder, ego_entity or None)
            document = imported.document
        else:
            document = _unpacked(upload, folder)
        nets = nets_of(document, folder)
        if action == "check":
            from risk_sac.failures.scenario_trial import try_document  # here, because loading libsumo takes a second

            return json.dumps(try_document(document, nets).model_dump(mode="json")).encode()
        try:
            check_document(document, nets)
        except ConfigError as error:
            if imported is None:
                raise
            raise imported.located(error) from error
        return json.dumps({"name": library.keep(document, library.own_files(document, nets))}).encode()


def _unpacked(upload: bytes, folder: Path) -> Scenario:
    """Reads a document and puts its nets into a folder, as SUMO nets of the present format.

    Raises:
      ConfigError: the upload is neither a document nor an archive of one, or a net cannot be read.
    """
    if not upload.startswith(b"PK"):
        return document_from(_text(upload))
    try:
        archive = zipfile.ZipFile(io.BytesIO(upload))
        entries = [entry for entry in archive.infolist() if not entry.is_dir()]
        if len(entries) > MAX_FILES or sum(entry.file_size for entry in entries) > MAX_BYTES:
            got = f"an archive of {len(entries)} files"
            raise ConfigError("", got, f"at most {MAX_FILES}, and {MAX_BYTES >> 20} MiB once unpacked")
        documents = [entry for entry in entries if entry.filename.endswith(DOCUMENT_ENDS)]
        if len(documents) != 1:
            raise ConfigError("", f"an archive with {len(documents)} documents", WANTED)
        if documents[0].file_size > MOST_BYTES:
            raise too_long(documents[0].file_size)
        document = document_from(_text(archive.read(documents[0])))
        for entry in entries:
            if entry is not documents[0]:
                _put_net(archive.read(entry), Path(entry.filename).name, document, folder)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        raise ConfigError("", f"an archive that cannot be read ({error})", WANTED) from error
    return document


def _imported(upload: bytes, folder: Path, ego: str | None) -> Imported:
    """Imports an archive of OpenSCENARIO, and puts its nets and roads into a folder."""
    with tempfile.TemporaryDirectory() as scratch:
        inside = Path(scratch).resolve()
        imported = import_scenario(unpack(upload, inside), within=inside, ego=ego)
    for name, content in imported.files.items():
        (folder / name).write_bytes(content)
    return imported


def _put_net(content: bytes, name: str, document: Scenario, folder: Path) -> None:
    if name not in networks(document):
        named = ", ".join(networks(document))
        remedy = f"did you mean network: {name}?" if name.startswith(tuple(networks(document))) else ""
        raise ConfigError("network", f"a file {name!r} that the document does not name", f"one of {named}", remedy)
    with tempfile.TemporaryDirectory() as scratch:
        upload = Path(scratch, "upload")
        upload.write_bytes(content)
        present_net(upload, Path(scratch), name).file.rename(folder / name)


def _text(content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        got = f"a document that is no UTF-8 from byte {error.start} on"
        raise ConfigError("", got, "a text", "save it as UTF-8") from error


def _picture(name: str) -> bytes:
    from risk_sac.failures.scenario_trial import scenario_png  # here, because loading matplotlib takes a second

    document, folder = (shipped_document(name), None) if name in shipped_names() else library.kept(name)
    return scenario_png(document, nets_of(document, folder))


if __name__ == "__main__":
    main()
