"""Scenario document: roads, parameters, actors and constraints, as users write them.

A document says nothing of lengths, limits, signals or ground: these are the net's. `risk_sac.scenario.interpret` makes
layouts of it.
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, StringConstraints, model_validator
from pydantic.fields import FieldInfo

from risk_sac.config.base import Chosen, Settings, Word
from risk_sac.config.campaign import JudgeConfig, Requirement
from risk_sac.config.distribution import (
    Distribution,
    HistogramBin,
    HistogramLaw,
    NumberLaw,
    RankCorrelation,
    UniformLaw,
    WeightsLaw,
    check_distribution,
)
from risk_sac.config.odd import Odd
from risk_sac.config.story import Story
from risk_sac.config.story_actions import Position
from risk_sac.config.values import ARITHMETIC, Comparison, Expression
from risk_sac.errors import ConfigError, did_you_mean

ScenarioName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
NetName = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\s]+$")]
EGO = "ego"
LONGEST_HORIZON_S = 400.0
Reference = Literal["stop_line", "crossing", "junction", "lane_end"]
ActorRole = Literal["adversary", "story", "background", "static"]


Net = NetName | Chosen[NetName]
Lane = NetName | Chosen[NetName]
Route = Annotated[tuple[NetName, ...], Field(min_length=1, max_length=200)]


class ScenarioParameter(Settings):
    """Axis of the scene space, or constant: `range`, `words`, `rows` or `value`."""

    unit: Annotated[str, Field(max_length=20)] = "1"
    meaning: Annotated[str, Field(max_length=200)] = ""
    range: tuple[float, float] | None = None
    """Least and greatest value."""
    words: Annotated[tuple[Word, ...], Field(min_length=1, max_length=50)] | None = None
    """Alternatives, each an equal part of the axis from 0 to 1."""
    rows: Annotated[tuple[Mapping[Word, float | Word], ...], Field(min_length=1, max_length=10_000)] | None = None
    """Numbers or words of names that vary together, each row an equal part of the axis from 0 to 1.
    The parameter's own name may be one of them, which makes a set of numbers."""
    value: Expression | None = None
    """Of a constant, or arithmetic over parameters before it."""
    step: Annotated[float, Field(gt=0)] | None = None
    """Of a range's grid, from the lower bound on."""
    distribution: Distribution | None = None
    """How likely its values are, truncated to the range; weights of words or rows. Without it all are alike."""
    source: Annotated[str, Field(max_length=300)] = ""
    """Publication that the distribution is from. Empty: it is a choice, as a range without distribution is."""
    odd: Annotated[str, Field(max_length=60)] | None = None
    """ODD field that bounds it too, such as `dynamic.vehicle_speed_mps`."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        given = [name for name in ("range", "words", "rows", "value") if getattr(self, name) is not None]
        if self.step is not None and self.range is None:
            raise ConfigError("step", f"{self.step:g} without a range", "a range beside it")
        if len(given) != 1:
            raise ConfigError("", " and ".join(given) or "none of them", "one of range, words, rows and value")
        if self.range is not None and self.range[0] > self.range[1]:
            remedy = "write the lower bound first"
            raise ConfigError("range", f"[{self.range[0]:g}, {self.range[1]:g}]", "low <= high", remedy)
        if self.words is not None and len(set(self.words)) < len(self.words):
            raise ConfigError("words", ", ".join(self.words), "each word once")
        for i, row in enumerate(self.rows or ()):
            if self.rows and row.keys() != self.rows[0].keys():
                raise ConfigError(
                    f"rows[{i}]", ", ".join(row), f"the names of the first row: {', '.join(self.rows[0])}"
                )
            for name in row:
                if self.rows and isinstance(row[name], str) != isinstance(self.rows[0][name], str):
                    raise ConfigError(f"rows[{i}].{name}", repr(row[name]), "words alone, or numbers alone")
        if self.distribution is not None:
            check_distribution(self.distribution, self.range, self.alternatives)
        return self

    @property
    def alternatives(self) -> int:
        """Number of its words or rows; 0: it has none."""
        return len(self.words or self.rows or ())

    def law(self, low: float, high: float) -> NumberLaw:
        """Returns the distribution over the axis (0 to 1 for words, rows).

        Args:
          low: where its axis begins, in a scene space that may be narrower than its range.
          high: where it ends.
        """
        if self.distribution is None:
            return UniformLaw(kind="uniform", low=low, high=high)
        if not isinstance(self.distribution, WeightsLaw):
            return self.distribution
        weights, size = self.distribution.weights, self.alternatives
        bins = (HistogramBin(low=i / size, high=(i + 1) / size, weight=weight) for i, weight in enumerate(weights))
        return HistogramLaw(kind="histogram", bins=tuple(bins))

    @property
    def names(self) -> tuple[str, ...]:
        """Names that its rows give values to."""
        return tuple(self.rows[0]) if self.rows else ()

    def words_of(self, name: str) -> tuple[str, ...]:
        """Returns the words of a name: its own, or those of rows."""
        if self.rows is None:
            return self.words or ()
        return tuple(dict.fromkeys(word for row in self.rows if isinstance(word := row.get(name), str)))


class Start(Settings):
    """Start of an actor.

    On or beside a lane, relative to another actor, at a crossing's kerb, or at a point.
    """

    position: Position | None = None
    """In the road file's coordinates, of the actor's reference point: its rear axle or, of one without, its middle."""
    lane: Lane | None = None
    """Lane, such as `road_1`, or an edge, of which the leftmost lane is taken that leads where the actor goes."""
    at_m: Expression | None = None
    """Front bumper from the lane's beginning, m; of an actor beside the road its middle."""
    before: Reference | None = None
    """What the front bumper is `distance_m` before; a crossing is met at its near edge."""
    distance_m: Expression | None = None
    ahead_of: Word | None = None
    """Actor whose front this one's rear is `gap_m` ahead of."""
    behind: Word | None = None
    """Actor whose rear this one's front is `gap_m` behind."""
    gap_m: Expression | None = None
    beside: Word | None = None
    """Actor whose front this one's front is `ahead_m` ahead of."""
    ahead_m: Expression | None = None
    lanes_left: Expression = 0.0
    """Lanes to the left of the other actor's; negative: to the right."""
    crossing: NetName | Chosen[NetName] | None = None
    """Edge whose crossing, at its end, the actor is about to walk over."""
    side: Literal["right", "left"] = "right"
    """From which side of the road, as vehicles on that edge see it."""
    setback_m: Expression = 0.0
    """From the kerb."""
    offset_m: Expression = 0.0
    """From the crossing's middle, to the right of the way across."""
    x_m: Expression | None = None
    y_m: Expression | None = None
    left_m: Expression = 0.0
    """Of the lane's middle."""
    heading_deg: Expression = 0.0
    """Counter-clockwise from the lane's direction; of a point from the x axis."""
    lead_in: bool | None = None
    """Whether this is where the actor is when the adversaries are released, after 1.5 s; if not, it is where it begins.
    An actor that starts relative to another one does as that one does; else the actor's place holds at the release."""

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        given = [name for name in _FORMS if getattr(self, name) is not None]
        if len(given) != 1:
            raise ConfigError("", " and ".join(given) or "none of them", f"one of {', '.join(_FORMS)}")
        form, belongs = given[0], _FORMS[given[0]]
        for name, field in type(self).model_fields.items():
            stated = getattr(self, name) != field.default
            if stated and name not in (form, *belongs, "lead_in"):
                raise ConfigError(name, "a value", f"nothing beside {form}, which goes with {', '.join(belongs)}")
            if not stated and name in belongs and field.default is None and form != "lane":
                raise ConfigError(name, "nothing", f"a value, beside {form}")
        if form == "lane" and (self.at_m is None) == (self.before is None):
            raise ConfigError("", "at_m and before" if self.before else "neither at_m nor before", "one of them")
        if self.before is not None and self.distance_m is None:
            raise ConfigError("distance_m", "nothing", f"the distance before the {self.before}, m")
        return self

    @property
    def reference(self) -> str | None:
        """The actor it is relative to."""
        return self.ahead_of or self.behind or self.beside


_WALK = ("setback_m", "offset_m")
_BESIDE = ("lanes_left", "left_m", "heading_deg")
_FORMS: Mapping[str, tuple[str, ...]] = {  # field that tells a form → those that go with it
    "lane": ("at_m", "before", "distance_m", "left_m", "heading_deg", *_WALK),
    "ahead_of": ("gap_m", *_BESIDE),
    "behind": ("gap_m", *_BESIDE),
    "beside": ("ahead_m", *_BESIDE),
    "crossing": ("side", *_WALK),
    "x_m": ("y_m", "heading_deg", *_WALK),
    "position": (),
}


class Box(Settings):
    """Size of an actor's body, and where its reference point lies."""

    length_m: Annotated[float, Field(gt=0, le=200)]
    width_m: Annotated[float, Field(gt=0, le=50)]
    ahead_m: Annotated[float, Field(ge=-100, le=100)] = 0.0
    """From the reference point, such as the rear axle's middle, forward to the box's middle."""


class Driven(Settings):
    """Body, initial speed and way of a road user."""

    body: Word | Chosen[Word] = "car"
    """Row of the table of bodies, or a parameter whose words are such rows."""
    speed: Expression = 0.0
    """Initial speed, m/s; along the heading."""
    route: Route | Chosen[Route] | None = None
    """Edges, or lanes, in the order of driving; without it the straightest way on."""
    turn: Word | Chosen[Word] | None = None
    """left, straight or right at the first junction, or a parameter with such words; instead of a route."""

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if self.route is not None and self.turn is not None:
            raise ConfigError("turn", "a turn beside a route", "one of route and turn")
        return self


class Moving(Driven):
    """The ego, or another actor."""

    start: Start
    box: Box | Chosen[Box] | None = None
    """Without it the usual size of the body, of which the reference point is the middle."""


class Actor(Moving):
    """Any road user but the ego."""

    role: ActorRole = "adversary"
    """The search drives adversaries, SUMO `background`; `story` follows the document's story; `static` never moves."""
    moves: Literal["lanes", "freely"] | None = None
    """In lanes as a vehicle or anywhere as a pedestrian; without it as its body usually does."""
    uses_oncoming: bool = False
    """Whether an adversary may leave its lanes for oncoming ones beside them."""
    when: Comparison | None = None
    """Scenes in which it is there."""


class Stream(Driven):
    """Background traffic on a lane: equal gaps, clear of other actors."""

    lane: Lane | Chosen[tuple[NetName, ...]] | Annotated[tuple[NetName, ...], Field(min_length=1)]
    """Lane, or several, which the vehicles take in turns."""
    before: Reference = "lane_end"
    from_m: Expression = 0.0
    """Where the traffic begins: this far before the reference; the first vehicle is a gap behind that."""
    gap_m: Expression
    """Between fronts."""
    speed: Expression
    count: Annotated[int, Field(ge=1, le=100)] = 2
    lead_in: bool = True
    clear_m: Annotated[float, Field(ge=0, le=1000)] = 10.0
    """Least gap to other actors on its lane; a vehicle without room starts behind them, or is left out."""


class Like(Settings):
    """The shipped family whose prior fits."""

    family: Word
    actors: Mapping[Word, Word] = {}
    """Adversary → the family's actor that it stands for; those of the same name stand for each other."""
    mirrored: bool = False
    """Whether what is on the left there is on the right here."""


class AllOf(Settings):
    """Constraints that all hold."""

    all: Annotated[tuple["Constraint", ...], Field(min_length=1, max_length=100)]


class AnyOf(Settings):
    """Constraints of which one holds at least."""

    any: Annotated[tuple["Constraint", ...], Field(min_length=1, max_length=100)]


Constraint = Comparison | AllOf | AnyOf


class SignalTiming(Settings):
    """Position of a traffic light in its cycle at the start."""

    id: NetName | None = None
    """Without it the first on the ego's way, or the only one of the net."""
    offset_s: Expression = 0.0


class ImportOrigin(Settings):
    """File of another format that a scenario was imported from."""

    file: Annotated[str, Field(max_length=200)]
    """Its name."""
    actors: Annotated[Mapping[Word, Annotated[str, Field(max_length=200)]], Field(max_length=101)] = {}
    """Actor → its name in that file."""
    entries: Annotated[Mapping[Word, Annotated[str, Field(max_length=200)]], Field(max_length=101)] = {}
    """Actor → catalog and entry of its body, such as `vehicle_catalog/car`, if no parameter chooses it."""
    remarks: Annotated[tuple[Annotated[str, Field(max_length=1000)], ...], Field(max_length=1000)] = ()
    """What was not read, and what changes on the way, each with its place."""


class Scenario(Settings):
    """A scenario, from which scenes are drawn."""

    name: ScenarioName
    summary: Annotated[str, Field(max_length=300)] = ""
    tags: Annotated[tuple[Annotated[str, Field(max_length=60)], ...], Field(max_length=30)] = ()
    """Such as `iso34502:cut-in`, `iso34502:merge/lane-change/deceleration` for road, ego and other, `ncap:CCRb`, or
    free words."""
    network: Net
    """A shipped net's name, or a SUMO net beside the document."""
    horizon_s: Expression = 15.0
    """Length of an episode, at most 400."""
    like: Like | None = None
    """Without it a search starts without a library of scripts."""
    parameters: Annotated[Mapping[Word, ScenarioParameter], Field(max_length=100)] = {}
    rank_correlation: RankCorrelation | None = None
    """Between parameters that are drawn by their distributions; without it they are independent."""
    ego: Moving
    actors: Annotated[Mapping[Word, Actor], Field(max_length=100)] = {}
    streams: Annotated[Mapping[Word, Stream], Field(max_length=50)] = {}
    constraints: Annotated[tuple[Constraint, ...], Field(max_length=100)] = ()
    road: Net | None = None
    """OpenDRIVE file beside the net, which positions of a story are stated in."""
    story: Story | None = None
    origin: ImportOrigin | None = None
    signal: SignalTiming = SignalTiming()
    friction: Expression = 1.0
    """Of tyres on the road, 0.4 to 1."""
    wary: bool = True
    """Whether drivers stop for an ego that stands askew."""
    set_speed: Expression | None = None
    """Speed that the ego keeps to, m/s: no lane's limit is above it, and an ego of SUMO changes lanes for its
    route alone. Without it the ego of a story keeps to its first speed, and any other drives as the limits allow."""
    odd: Odd = Odd()
    requirements: Annotated[tuple[Requirement, ...], Field(max_length=20)] = ()
    judge: JudgeConfig | None = None

    @property
    def values(self) -> Iterator[tuple[str, Expression]]:
        """All expressions, each with its path in the document."""
        return ((path, value) for path, field, value in _leaves("", self) if is_expression(field))

    @property
    def choices(self) -> Iterator[tuple[str, "Chosen[Any]"]]:
        """Yields the values that a parameter's word chooses, each with its path."""
        return ((path, value) for path, _, value in _leaves("", self) if isinstance(value, Chosen))

    @property
    def words(self) -> Mapping[str, tuple[str, ...]]:
        """Each name that stands for words, and these words."""
        pairs = [
            (name, parameter.words_of(name))
            for own, parameter in self.parameters.items()
            for name in parameter.names or (own,)
        ]
        return {name: words for name, words in pairs if words}

    @model_validator(mode="after")
    def _names(self) -> Self:
        if EGO in self.actors:
            raise ConfigError("actors.ego", "an actor of this name", "another name", "the ego has a part of its own")
        if both := sorted(self.actors.keys() & self.streams.keys()):
            raise ConfigError(f"streams.{both[0]}", "the name of an actor", "another name")
        varied = [name for name, parameter in self.parameters.items() if parameter.value is None]
        for name in self.rank_correlation.parameters if self.rank_correlation else ():
            if name not in varied:
                wanted = f"parameters that vary: {', '.join(varied)}"
                raise ConfigError("rank_correlation.parameters", repr(name), wanted, did_you_mean(name, varied))
        words = self.words
        for path, choice in self.choices:
            if choice.by not in words:
                wanted = f"a parameter with words: {', '.join(words) or 'there is none'}"
                raise ConfigError(f"{path}.by", repr(choice.by), wanted, did_you_mean(choice.by, words))
            if missing := sorted(set(words[choice.by]) - choice.of.keys()):
                raise ConfigError(f"{path}.of", ", ".join(choice.of), f"a value for {', '.join(missing)} too")
            if unknown := sorted(choice.of.keys() - set(words[choice.by])):
                remedy = did_you_mean(unknown[0], words[choice.by])
                wanted = f"one of {', '.join(words[choice.by])}"
                raise ConfigError(f"{path}.of.{unknown[0]}", "a word", wanted, remedy)
        for name, actor in self.actors.items():
            other = actor.start.reference
            if other is not None and other != EGO and other not in self.actors:
                known = [EGO, *(known for known in self.actors if known != name)]
                field = next(form for form in ("ahead_of", "behind", "beside") if getattr(actor.start, form))
                where = f"actors.{name}.start.{field}"
                raise ConfigError(where, repr(other), f"one of {', '.join(known)}", did_you_mean(other, known))
        if self.ego.start.reference is not None:
            raise ConfigError("ego.start", "a start relative to another actor", "a lane", "let the others start by it")
        return self

    @model_validator(mode="after")
    def _no_cycle(self) -> Self:
        for name in self.actors:
            chain, other = [name], self.actors[name].start.reference
            while other is not None and other != EGO:
                if other in chain:
                    cycle = " → ".join([*chain[chain.index(other) :], other])
                    raise ConfigError(
                        f"actors.{name}.start", f"a cycle: {cycle}", "a chain that ends at the ego or a lane"
                    )
                chain.append(other)
                other = self.actors[other].start.reference
        return self


def _leaves(path: str, within: Settings) -> Iterator[tuple[str, FieldInfo, Any]]:
    """Yields the plain values of nested settings, with path and field."""
    for name, field in type(within).model_fields.items():
        here, value = f"{path}.{name}".removeprefix("."), getattr(within, name)
        for key, part in _parts(value):
            if isinstance(part, Settings) and not isinstance(part, Chosen):
                yield from _leaves(f"{here}{key}", part)
            elif part is not None:
                yield f"{here}{key}", field, part


def _parts(value: Any) -> Iterator[tuple[str, Any]]:
    """Yields members of nested mappings and tuples of settings, with their paths."""
    if isinstance(value, Mapping):
        for key, member in value.items():
            yield from ((f".{key}{inner}", part) for inner, part in _parts(member))
    elif isinstance(value, tuple) and any(isinstance(member, Settings | tuple) for member in value):
        for i, member in enumerate(value):
            yield from ((f"[{i}]{inner}", part) for inner, part in _parts(member))
    else:
        yield "", value


def is_expression(field: FieldInfo) -> bool:
    """Whether a field holds expressions."""
    marks = [field.metadata, *(getattr(kind, "__metadata__", ()) for kind in get_args(field.annotation))]
    return any(ARITHMETIC in mark for mark in marks)
