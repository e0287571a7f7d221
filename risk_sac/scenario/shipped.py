"""Scenarios that ship with the package: a document and its net in each folder of `sumo_nets/`."""

from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

from risk_sac.config import Scenario
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.scenario.reading import document_from

FOLDER = Path(str(files("sumo_nets")))
PAPER_FAMILIES = ("low", "mixed", "dense")  # families of the paper, which have priors


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
    network = document.network
    words = document.parameters[network].words if isinstance(network, str) and network in document.parameters else None
    yield from network.of.values() if not isinstance(network, str) else words or (network,)


def nets_of(document: Scenario, folder: Path | None = None) -> Mapping[str, str]:
    """Finds the file of each network that a document names.

    Args:
      document: of the scenario.
      folder: beside which its own nets lie; None: it has shipped ones alone.

    Raises:
      ConfigError: a net is not there.
    """
    nets = {}
    for name in networks(document):
        own = None if folder is None or "/" in name or name.startswith(".") else folder / name
        if own is not None and own.is_file():
            nets[name] = str(own.absolute())
        else:
            beside = own is not None and own.with_name(f"{own.name}.net.xml").is_file()
            nets[name] = shipped_net(name, f"did you mean {name}.net.xml?" if beside else "")
    return nets
