"""Scenarios that ship with the package: a document and its net in each folder of `sumo_nets/`."""

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

from risk_sac.config import Scenario
from risk_sac.config.scenario import Net
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.scenario.reading import document_from

FOLDER = Path(str(files("sumo_nets")))
PAPER_FAMILIES = ("low", "mixed", "dense")  # families of the paper, which have libraries


def scenario_file(name: str) -> Path:
    """Returns the file of a shipped document; it may not be there."""
    return FOLDER / name / f"{name}.yaml"


@cache
def shipped_names() -> tuple[str, ...]:
    """Names of the shipped scenarios: the three families of the paper, then the others by name."""
    others = sorted(path.parent.name for path in FOLDER.glob("*/*.yaml") if path.parent.name == path.stem)
    return (*PAPER_FAMILIES, *(name for name in others if name not in PAPER_FAMILIES))


@cache
def shipped_document(name: str) -> Scenario:
    """Reads a shipped document; raises `ConfigError` if there is none of this name."""
    if name not in shipped_names():
        known = shipped_names()
        raise ConfigError("scenario", repr(name), f"one of {', '.join(known)}", did_you_mean(name, known))
    return document_from(scenario_file(name).read_text())


def shipped_net(name: str, remedy: str = "") -> str:
    """Returns a shipped net's file below `sumo_nets/`; raises `ConfigError`, with a remedy, if there is none."""
    known = sorted(path.parent.name for path in FOLDER.glob("*/*.net.xml"))
    if name not in known:
        raise ConfigError("network", repr(name), f"a net beside the document, or one of {', '.join(known)}", remedy)
    return f"{name}/{name}.net.xml"


def networks(document: Scenario) -> Iterator[str]:
    """All networks that a document names."""
    yield from _alternatives(document, document.network)


def roads(document: Scenario) -> Iterator[str]:
    """All road files that a document names."""
    if document.road is not None:
        yield from _alternatives(document, document.road)


def _alternatives(document: Scenario, name: Net) -> Iterable[str]:
    return document.words.get(name, (name,)) if isinstance(name, str) else name.of.values()


def nets_of(document: Scenario, folder: Path | None = None) -> Mapping[str, str]:
    """Finds the file of each network that a document names.

    Args:
      document: of the scenario.
      folder: beside which its own nets lie; None: it has shipped ones alone.

    Raises:
      ConfigError: a net or a road file is not there.
    """
    for name in roads(document):
        if folder is None or not _beside(name, folder):
            raise ConfigError("road", repr(name), "an OpenDRIVE file beside the document and its net")
    nets = {}
    for name in networks(document):
        if folder is not None and _beside(name, folder):
            nets[name] = str((folder / name).absolute())
        else:
            beside = folder is not None and _beside(f"{name}.net.xml", folder)
            nets[name] = shipped_net(name, f"did you mean {name}.net.xml?" if beside else "")
    return nets


def _beside(name: str, folder: Path) -> bool:
    """Whether a name is that of a file in a folder."""
    return "/" not in name and not name.startswith(".") and (folder / name).is_file()
