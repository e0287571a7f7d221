"""What can be posted."""

from typing import Literal

from risk_sac.config import FamilyName, Method, MethodName, Odd, Requirement
from risk_sac.failures.export.formats import FormatName
from risk_sac.records import Record


class SceneParameter(Record):
    """One dimension of a family's scene space."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    odd: str | None
    """The field of the ODD that narrows it, such as `dynamic.ego_speed_mps`."""


class Family(Record):
    """A scenario family: what is searched, and where."""

    name: FamilyName
    summary: str
    horizon_steps: int
    """Length of an episode in control steps of 0.1 s."""
    parameters: list[SceneParameter]
    adversaries: list[str]
    odd: Odd
    """Default operational design domain; a campaign's own narrows it."""
    odd_limits: Odd
    """How far a campaign's own may go: a few fields may be wider than the default, as far as this."""
    requirements: list[Requirement]
    """What the default ego has to meet in the default ODD. A campaign's own ODD and ego change their thresholds; the
    campaign's own requirements come on top, under other names."""


class Signal(Record):
    """What the formula of a requirement may speak of, with a value in every step."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


class ExportFormat(Record):
    """A format of other tools."""

    name: FormatName
    title: str
    what: str
    of: Literal["failure", "episodes"]
    """What it holds: one failure, or all episodes of runs."""
    suffix: str
    """Of what is downloaded."""
    media_type: str
    missing: list[str]
    """Packages that are not installed here, without which it cannot be made."""


class ExportFormats(Record):
    """All of them."""

    items: list[ExportFormat]


class Families(Record):
    """All scenario families, and what requirements may speak of in each."""

    items: list[Family]
    signals: list[Signal]


class NamedMethod(Method):
    """A search method."""

    name: MethodName


class Ego(Record):
    """Who can drive the ego."""

    name: str
    """Of kind sumo: what `ego.profile` of a campaign takes; else what `ego.driver` does."""
    kind: Literal["sumo", "python", "remote"]
    """sumo: SUMO's models; python: in the worker's own process; remote: in a process of the operator's."""
    version: str | None
    """A campaign keeps it, and its runs go on with no other; null of SUMO's models, whose version is libsumo's."""
    response_time_s: float
    """Within which it responds to a danger, s; requirements follow from it."""
    deadline_s: float | None
    """For each of its answers, s; an episode in which it misses it is invalid."""
    summary: str


class Egos(Record):
    """All egos; the operator registers them."""

    items: list[Ego]


class Methods(Record):
    """All search methods."""

    items: list[NamedMethod]
