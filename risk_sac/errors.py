"""Every error this project raises on purpose.

RiskSacError
├── ConfigError            a setting is unknown, out of range or contradicts another
│   ├── OddError           an ODD empties the scene space or contradicts itself
│   ├── FormulaError       a requirement cannot be parsed or monitored online
│   └── MapError           no pattern fits on a map, or it has no such place
├── SceneError             a scene is not a point of its family's space
│   └── InfeasibleScene    C_hard: the scene's first frame is physically impossible
├── SimulationError        libsumo refused a command or died
├── EgoFailed              a registered ego missed its deadline, answered nonsense or crashed
├── CheckpointError        a checkpoint is missing or belongs to another run
│   └── DamagedCheckpoint  its bytes are not those that were written
├── DamagedError           a file that carries its own checksum is not as it was written
└── NotFinite              a number at a boundary is NaN or infinite
"""

from collections.abc import Iterable
from difflib import get_close_matches


class RiskSacError(Exception):
    """Root of all errors that this project raises on purpose."""


class ConfigError(RiskSacError, ValueError):
    """A setting is wrong.

    A `ValueError`, so that pydantic validators may raise it; `risk_sac.config.base` completes its path.
    """

    def __init__(self, field: str, got: str, expected: str = "", remedy: str = "") -> None:
        """A wrong setting.

        Args:
          field: its dotted path, flag or variable, as a user wrote it; "": the whole input.
          got: what it holds, as text; or, without `expected`, what is wrong with it.
          expected: what it should hold.
          remedy: what to do about it.
        """
        super().__init__(field, got, expected, remedy)
        self.field = field
        self.got = got
        self.expected = expected
        self.remedy = remedy
        self.others: tuple[ConfigError, ...] = ()  # what else is wrong with the same input

    def __str__(self) -> str:
        return self._text(self.field)

    def _text(self, where: str) -> str:
        got = f"got {self.got}; wanted {self.expected}" if self.expected else self.got
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{where}: {got}{remedy}".removeprefix(": ")


class OddError(ConfigError):
    """An ODD contradicts itself or leaves no scene to search."""


class FormulaError(ConfigError):
    """An STL formula cannot be parsed, or cannot be monitored online.

    `position` is the 0-based column of the offending text, or None where it has none.
    """

    def __init__(
        self, got: str, expected: str = "", remedy: str = "", *, field: str = "", position: int | None = None
    ) -> None:
        super().__init__(field, got, expected, remedy)
        self.args = got, expected, remedy  # what pickle calls this with
        self.position = position

    def __str__(self) -> str:
        column = "" if self.position is None else f"column {self.position}"
        return self._text(": ".join(filter(None, (self.field, column))))


class MapError(ConfigError):
    """A map that cannot be read or does not fit a pattern."""


class SceneError(RiskSacError):
    """A scene does not belong to its family's space."""


class InfeasibleScene(SceneError):
    """C_hard rejects the scene; `reason` is the rule's name."""

    def __init__(self, message: str, *, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


class SimulationError(RiskSacError):
    """libsumo refused a command, or the simulation ended unexpectedly."""


class EgoFailed(RiskSacError):
    """A registered ego that fails; `reason` is the rule's name ("ego_deadline")."""

    def __init__(self, message: str, *, reason: str) -> None:
        super().__init__(message)
        self.reason = reason


class CheckpointError(RiskSacError):
    """A checkpoint is missing, damaged, or was written by another run."""


class DamagedCheckpoint(CheckpointError):
    """A checkpoint's bytes are not those that were written."""


class DamagedError(RiskSacError):
    """A file that does not match its own checksum."""


class NotFinite(RiskSacError):
    """A value that must be finite is not; the message names it."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Asks whether the closest known name was meant; empty if none is.

    The dashes of flags make no two names alike.
    """
    names = {each.lstrip("-"): each for each in known}
    close = get_close_matches(name.lstrip("-"), names, n=1)
    return f"did you mean {names[close[0]]}?" if close else ""
