"""Checks, keeps and draws scenarios and places, in its own process.

It is started as `service.networks.helper QUESTION ANSWER ACTION`, with limits on time and memory, by
`service.networks.scenarios`:

    add EGO        checks the document, or the archive, that the question holds, keeps it, and answers with its name
    check EGO      checks it, plays 20 scenes of it, and answers with a `ScenarioCheck`
    picture NAME   answers with a PNG
    pictures       answers with the PNGs of all that ship, by name, in base64

EGO is the ego among the entities of OpenSCENARIO, or empty. `service.networks.surveys` starts it in the folder of a
checked network, since a search takes seconds that would block the server:

    survey                 writes `places.json`, `places.png` and `roads.json` beside the net
    keep PATTERN [PLACE]   keeps that place, or all of the pattern, and answers with the families that they are
"""

import base64
import io
import json
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

from risk_sac.config import Scenario
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.failures.net import RoadsBody, surfaces
from risk_sac.maps.convert import present_net
from risk_sac.maps.documents import MAX_BYTES, MAX_FILES
from risk_sac.maps.finder import FINDERS, Map, survey
from risk_sac.maps.found import Pattern
from risk_sac.openscenario.scenario_file import Imported, import_scenario
from risk_sac.openscenario.sources import holds_scenario, unpack
from risk_sac.run_folder.durable import replace_file, write_sealed
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
from risk_sac.world.read_net import read_net
from service.networks.schemas import (
    MAX_PLACES,
    MEMORY_BYTES,
    PICTURE,
    PLACES,
    PROGRESS,
    ROADS,
    ZIPPED,
    Elsewhere,
    FoundPlace,
    Places,
)

DOCUMENT_ENDS = (".yaml", ".yml", ".json")
WANTED = "one document (.yaml or .json) and the nets that it names, or an OpenSCENARIO file with what it names"


NET = Path("net.xml")
TOLD_EVERY_S = 1.0
DECIMALS = 1  # of a metre, in the ground of a network


def main() -> None:
    """Does what the arguments say, and writes the answer."""
    question, answer, action, *arguments = sys.argv[1:]
    try:
        if action in ACTIONS:
            content = ACTIONS[action](*arguments)
        else:
            content = _posted(Path(question).read_bytes(), action, *arguments)
    except ConfigError as error:
        faults = [(fault.field, fault.got, fault.expected, fault.remedy) for fault in (error, *error.others)]
        content = json.dumps({"faults": faults}).encode()
    except DamagedError as error:
        content = json.dumps({"damaged": str(error)}).encode()
    except MemoryError:
        got = f"a network or scenario that needs more than {MEMORY_BYTES >> 20} MiB"
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
    """Reads a document and writes its nets in SUMO's present format.

    Raises:
      ConfigError: the upload is neither a document nor an archive of one, or a net cannot be read.
    """
    if upload.lstrip(b"\xef\xbb\xbf").startswith(b"<"):
        raise ConfigError("", "an XML file", WANTED, ZIPPED)
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


def _pictures() -> bytes:
    return json.dumps({name: base64.b64encode(_picture(name)).decode() for name in shipped_names()}).encode()


def _survey() -> bytes:
    from risk_sac.failures.from_above import map_png  # here, because loading matplotlib takes a second

    net = read_net(NET)
    map_survey = survey(net, tell=SurveyProgress())
    places = Places(
        items=[FoundPlace.model_validate(fit.told()) for fit in map_survey.fits],
        elsewhere=[Elsewhere.model_validate(misfit.told()) for misfit in map_survey.misfits],
        nowhere=dict(map_survey.nowhere),
    )
    replace_file(Path(PICTURE), map_png(net, map_survey))
    replace_file(Path(ROADS), RoadsBody.of(surfaces(net), DECIMALS).model_dump_json().encode())
    write_sealed(Path(PLACES), places)
    return b"{}"


class SurveyProgress:
    """Writes the share of spots that were looked at, now and then."""

    def __init__(self) -> None:
        self._told = time.monotonic()

    def __call__(self, share: float) -> None:
        """Writes the share if the last one was written long ago."""
        if time.monotonic() - self._told >= TOLD_EVERY_S:
            Path(PROGRESS).write_text(f"{share:.3f}")
            self._told = time.monotonic()


def _keep_places(name: str, place: str | None = None) -> bytes:
    pattern: Pattern = next(pattern for pattern in FINDERS if pattern == name)
    chosen = Map(NET)
    fits = chosen.fits(pattern, place)
    if len(fits) > MAX_PLACES:
        raise ConfigError("places", f"{len(fits)} places where {pattern} fits", f"at most {MAX_PLACES}", "name one")
    return json.dumps({"families": [chosen.keep(fit) for fit in fits]}).encode()


ACTIONS: Mapping[str, Callable[..., bytes]] = {
    "picture": _picture,
    "pictures": _pictures,
    "survey": _survey,
    "keep": _keep_places,
}

if __name__ == "__main__":
    main()
