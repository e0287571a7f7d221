"""Catalogue of defects: known faults as rows of data, in `catalogue.toml`.

Sources of the classes: Garcia et al. 2020, "A comprehensive study of autonomous vehicle bugs" (ICSE), for faults of
perception, tracking, prediction, planning and control; SUMO's documentation, page "Safety", section "Deliberately
causing collisions", for settings of its own driver. Choice: the values.
"""

import hashlib
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

from risk_sac.config import EgoConfig, Settings
from risk_sac.errors import ConfigError

HERE = Path(__file__).parent
HASH_DIGITS = 12
DefectKind = Literal["perception", "memory", "prediction", "planning", "control", "sumo"]


class Parameter(Settings):
    """The number that says how strong a defect is."""

    name: str
    value: float
    unit: str


class Defect(Settings):
    """A known fault that can be planted into an ego."""

    name: str
    """What `ego.defects` of a campaign names."""
    kind: DefectKind
    """sumo: a setting of SUMO's own driver; the others are planted into registered Python egos."""
    sentence: str
    """What the ego does wrong."""
    parameter: Parameter
    families: tuple[str, ...]
    """In which it matters."""
    test_set: bool = False
    """Whether it is kept from tuning; methods are compared on these."""
    decorator: str = ""
    """Class in the module of its kind."""
    settings: Mapping[str, float] = {}
    """Of SUMO's driver, see `risk_sac.sim.placing`."""

    @property
    def base(self) -> str:
        """The ego that it is studied with, as `--ego` names it."""
        return "default" if self.kind == "sumo" else "idm-aeb"

    @property
    def fingerprint(self) -> bytes:
        """Bytes that determine its effect: its row, and the code of its kind."""
        sources = [] if self.kind == "sumo" else [HERE / "defective.py", HERE / f"{self.kind}.py"]
        row = self.model_dump_json(exclude={"sentence", "families", "test_set"}).encode()
        return b"\0".join([row, *(source.read_bytes() for source in sources)])


def _rows() -> dict[str, Defect]:
    tables = tomllib.loads((HERE / "catalogue.toml").read_text(encoding="utf-8"))
    return {name: Defect.model_validate({"name": name, **row}) for name, row in tables.items()}


DEFECTS: Mapping[str, Defect] = _rows()


def planted(ego: EgoConfig) -> tuple[Defect, ...]:
    """Returns the defects of an ego.

    Raises:
      ConfigError: one does not exist, or does not fit the ego.
    """
    found = []
    for name in ego.defects:
        if name not in DEFECTS:
            alike = get_close_matches(name, DEFECTS, cutoff=0.0)
            remedy = "`risk-sac egos defects` and GET /v1/egos list them"
            raise ConfigError(
                "ego.defects", f"{name!r}", f"defects of the catalogue, such as {', '.join(alike)}", remedy
            )
        of_sumo = DEFECTS[name].kind == "sumo"
        if of_sumo and ego.driver is not None:
            got = f"{name!r}, a setting of SUMO's driver, for the registered ego {ego.driver!r}"
            raise ConfigError("ego.defects", got, remedy="leave driver out, or choose a defect of another kind")
        if not of_sumo and ego.driver is None:
            got = f"{name!r}, which SUMO's driver cannot have"
            remedy = f"name a driver, such as {DEFECTS[name].base}, or choose a defect of the kind sumo"
            raise ConfigError("ego.defects", got, remedy=remedy)
        found.append(DEFECTS[name])
    return tuple(found)


def settings_of(ego: EgoConfig) -> dict[str, float]:
    """Returns the settings of SUMO's driver that an ego's defects change."""
    return {key: value for defect in planted(ego) for key, value in defect.settings.items()}


def version_of(ego: EgoConfig) -> str:
    """Returns a hash of an ego's defects, their parameters and their code."""
    return hashlib.sha256(b"\0".join(defect.fingerprint for defect in planted(ego))).hexdigest()[:HASH_DIGITS]
