"""Catalogue of defects: known faults as rows of data, in `catalogue.toml`.

Sources of the classes: Garcia et al. 2020, "A comprehensive study of autonomous vehicle bugs" (ICSE), for faults of
perception, tracking, prediction, planning and control; SUMO's documentation, page "Safety", section "Deliberately
causing collisions", for settings of its own driver. Choice: the values.
"""

import hashlib
import tomllib
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Literal

import numpy as np

from risk_sac.config import EgoConfig, Settings
from risk_sac.egos.defects.condition import Condition
from risk_sac.egos.seam import Command, Ego, EpisodeStart, Perceived, Trajectory
from risk_sac.errors import ConfigError

HERE = Path(__file__).parent
HASH_DIGITS = 12
Tier = Literal["easy", "medium", "hard"]
DefectKind = Literal["perception", "memory", "prediction", "planning", "control", "sumo"]


class DefectStrength(Settings):
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
    parameter: DefectStrength
    families: tuple[str, ...]
    """In which it matters."""
    test_set: bool = False
    """Whether it is kept from tuning; methods are compared on these."""
    decorator: str = ""
    """Class in the module of its kind."""
    settings: Mapping[str, float] = {}
    """Of SUMO's driver, see `risk_sac.sim.roads`."""
    when: Condition | None = None
    """Makes it a conjunction: when it acts, and on which of the others."""
    ego: str = "idm-aeb"
    """Registered ego that it is studied with."""
    tier: Tier | None = None
    """How hard random search finds a conjunction, by `report/measured/tiers.csv`."""

    @property
    def base(self) -> str:
        """The ego that it is studied with, as `--ego` names it."""
        return "default" if self.kind == "sumo" else self.ego

    @property
    def fingerprint(self) -> bytes:
        """Bytes that determine its effect: its row, and the code of its kind."""
        sources = [] if self.kind == "sumo" else [HERE / "defective.py", HERE / f"{self.kind}.py"]
        told = {"sentence", "families", "test_set", "ego", "tier"}
        if self.when is None:
            told.add("when")  # as before there were conjunctions
        else:
            sources.append(HERE / "conjunction.py")
        row = self.model_dump_json(exclude=told).encode()
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
    defects = []
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
        defects.append(DEFECTS[name])
    return tuple(defects)


def settings_of(ego: EgoConfig) -> dict[str, float]:
    """Returns the settings of SUMO's driver that an ego's defects change."""
    return {key: value for defect in planted(ego) for key, value in defect.settings.items()}


def version_of(ego: EgoConfig) -> str:
    """Returns a hash of an ego's defects, their parameters and their code."""
    return hashlib.sha256(b"\0".join(defect.fingerprint for defect in planted(ego))).hexdigest()[:HASH_DIGITS]


class Planted:
    """Ego with defects, and the same ego without them until their commands differ.

    Attributes:
      reached_s: when a defect first changed a command, from the first frame on; None before.
    """

    reached_s: float | None
    _began_s: float | None

    def __init__(self, make: Callable[[], Ego], defects: Sequence[Defect]) -> None:
        """Makes both egos; the first defect is the nearest to the ego."""
        self._sound, self._ego = make(), make()
        for defect in defects:
            decorator = getattr(import_module(f"risk_sac.egos.defects.{defect.kind}"), defect.decorator)
            if defect.when is None:
                self._ego = decorator(self._ego, defect.parameter.value)
            else:
                conditional = import_module("risk_sac.egos.defects.conjunction").Conditional  # loads the simulator
                self._ego = conditional(self._ego, decorator, defect.parameter.value, defect.when)

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode."""
        self.reached_s = self._began_s = None
        self._sound.reset(episode)
        self._ego.reset(episode)

    def act(self, perceived: Perceived) -> Command:
        """Returns the command of the ego with the defects; the other one is asked until their commands differ."""
        command = self._ego.act(perceived)
        if self._began_s is None:
            self._began_s = perceived.time_s
        if self.reached_s is None and not _same(command, self._sound.act(perceived)):
            self.reached_s = round(perceived.time_s - self._began_s, 6)
        return command

    def close(self) -> None:
        """Closes both egos."""
        self._sound.close()
        self._ego.close()


def _same(command: Command, other: Command) -> bool:
    if isinstance(command, Trajectory) or isinstance(other, Trajectory):
        return type(command) is type(other) and all(map(np.array_equal, command, other))
    return tuple(command) == tuple(other)
