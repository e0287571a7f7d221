"""Campaigns as users post them, their runs, and their demand.

The same `CampaignSpec` is the REST body, the CLI's YAML and the stored record.
"""

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from operator import not_
from typing import Annotated, Any, Literal, Self
from urllib.parse import unquote, urlsplit

from pydantic import AfterValidator, BeforeValidator, Field, StringConstraints, model_validator

from risk_sac.config.base import Settings, Word, is_none, shown
from risk_sac.config.ego import EgoConfig
from risk_sac.config.learner import LearnerConfig
from risk_sac.config.methods import IID_METHODS, MethodName, RunMethod, method_of
from risk_sac.config.odd import Odd
from risk_sac.config.story import DeviationBounds
from risk_sac.errors import ConfigError
from risk_sac.host.machine import cores

ParameterName = Annotated[str, StringConstraints(min_length=1, max_length=200)]


class BoundaryConfig(Settings):
    """Parameters over which the method `boundary` searches, and what failing means."""

    over: Annotated[tuple[ParameterName, ...], Field(min_length=2, max_length=4)]
    """Scene parameters with a range. The picture's axes are the first two."""
    others: Literal["fixed", "drawn"] = "fixed"
    """fixed: each other parameter has its median. drawn: it is drawn from its distribution, so the boundary is where
    half of the scenes fail."""
    at: Annotated[Mapping[ParameterName, float | Word], Field(max_length=100)] = {}
    """Other parameter → number or word that it has in all scenes."""
    requirement: Annotated[str, Field(max_length=40)] = ""
    """The one whose violation is failing; by default a contact, or a violation of any requirement that counts."""

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        if len(set(self.over)) < len(self.over):
            raise ConfigError("over", ", ".join(self.over), "each parameter once")
        if twice := [name for name in self.over if name in self.at]:
            raise ConfigError(f"at.{twice[0]}", "a parameter of `over`", "another one")
        return self


FamilyName = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,59}$")]
"""A scenario that ships, or one that a library of scenarios keeps; its last digits are of its document and nets."""


def _tag(text: str) -> str:
    if not re.fullmatch(TAG, text):
        raise ConfigError("", shown(text), "1 to 30 lowercase letters, digits or ._:-, a letter or digit first")
    return text


TAG = "[a-z0-9][a-z0-9._:-]{0,29}"
Tag = Annotated[str, AfterValidator(_tag), Field(json_schema_extra={"pattern": f"^{TAG}$"})]
Tags = Annotated[tuple[Tag, ...], Field(max_length=10)]
Seed = Annotated[int, Field(ge=0, le=2**31 - 1)]
MOST_EPISODES = 2_000_000  # of a campaign; the database takes about 1.2 KB for each
MOST_FAMILIES = 100  # of a campaign
Identifier = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,39}$")]


def _batch(given: object) -> object:
    """Returns the number that `auto` means here; anything else unchanged."""
    return min(AUTO_EACH * cores(), MOST_BATCH) if given == "auto" else given


AUTO_EACH, MOST_BATCH = 2, 1024  # episodes of a round: for each processor if it is `auto`, and at most
Batch = Annotated[
    int,
    Field(ge=1, le=MOST_BATCH),
    BeforeValidator(_batch, json_schema_input_type=Annotated[int, Field(ge=1, le=MOST_BATCH)] | Literal["auto"]),
]


class Requirement(Settings):
    """One STL requirement over the published signals; past-time operators only."""

    name: Identifier
    """One's own, or that of a shipped requirement, of which only `counts` is then given."""
    formula: Annotated[str, Field(max_length=500)] = ""
    """Needed for a requirement of one's own."""
    scale: Annotated[float, Field(ge=1e-3, le=1e6)] = 1.0
    """Physical size of a clear margin, in the formula's unit; robustness is divided by it."""
    counts: Literal["failure", "report"] = "failure"
    """failure: an episode that violates it is a failure. report: it is measured and reported only."""
    shapes: bool = True
    """Whether it counts in the soft minimum and so in the reward's shaping; if not, it is only monitored."""


class Budget(Settings):
    """Budget of each run; equal for all methods of a campaign."""

    episodes: Annotated[int, Field(ge=1, le=100_000)] = 300
    """Search episodes, rejected scenes included."""
    evaluation_episodes: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Episodes of the frozen policy after the search."""
    cpu_s: Annotated[float, Field(ge=0.1, le=1e7)] | None = None
    """Processor time after which a search ends, s, without compilation."""
    least_episodes: Annotated[int, Field(ge=1, le=100_000)] = 1
    """Search episodes that are played whatever the processor time, so that one run serves two budgets."""
    all_points: bool = False
    """Whether `story-sweep` is refused where the grid has more than `episodes` points. False: it plays a stratified
    sample of them."""

    batch: Batch = 1
    """Episodes that are asked for at a time, and played in parallel; at most 16 for each processor. `auto`: two for
    each processor, as a number from then on. The results depend on it. A policy plays a round as it was at its
    beginning."""

    @model_validator(mode="after")
    def _least_is_affordable(self) -> Self:
        if self.least_episodes > self.episodes:
            raise ConfigError("least_episodes", f"{self.least_episodes}", f"at most episodes, {self.episodes}")
        return self

    @property
    def total_episodes(self) -> int:
        """Episodes of both phases."""
        return self.episodes + self.evaluation_episodes


class Iid(Settings):
    """Final phase that estimates the failure rate in scenes no search chose.

    They are drawn from the ODD independently, by the document's distributions and else uniformly. They are played with
    undisturbed traffic and with random adversaries, in runs of their own.
    """

    episodes: Annotated[int, Field(ge=1, le=100_000)] = 300
    """Scenes of each family and each kind of traffic, those included that are refused before the first step."""
    seed: Seed = 0
    """Of scenes, actions and SUMO; no stream of a search is the same, whatever its seed."""


class RateStart(Settings):
    """Failing scenes where a run of `rate` begins; no estimate counts them."""

    scenes: Annotated[tuple[Mapping[ParameterName, float], ...], Field(min_length=1, max_length=300)]
    """Each with a value of every parameter. Those beyond what the ODD leaves are not used."""


PreventingDriver = Literal["r157", "fsm", "rss", "defensive"]


class JudgeConfig(Settings):
    """Whose word counts when failures are judged."""

    drivers: Annotated[tuple[PreventingDriver, ...], Field(min_length=1)] = ("r157", "fsm", "rss", "defensive")
    """Reference drivers, each of which makes a failure preventable that it would have prevented. The others are asked
    as well, and reported only."""


PriorName = Annotated[str, Field(min_length=1, max_length=500, pattern=r"^[^\x00-\x1f]+$")]


class RunSpec(Settings):
    """One run: the unit of scheduling, checkpoint and retry."""

    family: FamilyName
    method: RunMethod
    seed: Seed
    budget: Budget = Budget()
    ego: EgoConfig = EgoConfig()
    odd: Odd = Odd()
    requirements: Annotated[tuple[Requirement, ...], Field(max_length=20)] = ()
    learner: LearnerConfig = LearnerConfig()
    judge: JudgeConfig = JudgeConfig()
    prior: PriorName = "shipped"
    deviation: DeviationBounds | None = None
    """Of actors from the story of their scenario; null: the scenario's own bounds."""
    boundary: BoundaryConfig | None = None
    """Of the method `boundary`; other methods have none."""
    rate: RateStart | None = Field(default=None, exclude_if=is_none)
    """Of the method `rate`; other methods have none."""

    @property
    def id(self) -> str:
        """Unique within its campaign."""
        return f"{self.family}-{self.method}-{self.seed}"

    @property
    def iid(self) -> bool:
        """Whether it belongs to an i.i.d. phase, and searches nothing."""
        return self.method in IID_METHODS

    @property
    def stream(self) -> int:
        """Seed of all its generators.

        In an i.i.d. phase it is a number that no search has.
        """
        if not self.iid:
            return self.seed
        drawn = hashlib.sha256(f"{self.family} {self.method} {self.seed}".encode()).digest()
        return 2**31 + int.from_bytes(drawn[:4]) // 2

    @property
    def digest(self) -> str:
        """SHA-256 of the canonical JSON; the same digest means the same results."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()


def plain_url(text: str) -> str:
    """Checks a URL; refuses parts that parsers read differently (user, backslash)."""
    try:
        parts = urlsplit(text)
        plain = text.isascii() and text.isprintable() and not set(text) & set(" \\@#") and parts.port != 0
    except ValueError:  # of the port, or of brackets
        plain = False
    if not plain or parts.scheme not in ("http", "https") or not parts.hostname or ".." in unquote(parts.path):
        expected = "an http or https URL in ASCII without user, fragment, space, backslash or .."
        raise ConfigError("", shown(text), expected)
    return text


def check_once(field: str, values: Sequence[object]) -> None:
    """Refuses values with repeats."""
    if len(set(values)) < len(values):
        raise ConfigError(field, f"{list(values)}", "each value once")


class CampaignSpec(Settings):
    """Families × methods × seeds on one equal budget."""

    label: Annotated[str, Field(max_length=200)] = ""
    tags: Tags = Field(default=(), exclude_if=not_)
    """Words to find it by."""
    families: Annotated[tuple[FamilyName, ...], Field(min_length=1, max_length=MOST_FAMILIES)]
    methods: Annotated[tuple[MethodName, ...], Field(min_length=1, max_length=20)] = ("risk-sac",)
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1, max_length=100)] = (0,)
    budget: Budget = Budget()
    ego: EgoConfig = EgoConfig()
    odd: Odd = Odd()
    requirements: Annotated[tuple[Requirement, ...], Field(max_length=20)] = ()
    learner: LearnerConfig = LearnerConfig()
    judge: JudgeConfig = JudgeConfig()
    prior: PriorName = "shipped"
    """What methods with a prior start from: `shipped`, `none`, or the scripts of an earlier campaign, by its id; on the
    command line the folder of a run or campaign. They are copied."""
    deviation: DeviationBounds | None = None
    """Of actors from the stories of the scenarios; null: each scenario's own bounds."""
    iid: Iid | None = None
    """Null: none, and nothing is said of how often the ego fails."""
    boundary: BoundaryConfig | None = None
    """What the method `boundary` searches; null where it is not among the methods."""
    rate: RateStart | None = Field(default=None, exclude_if=is_none)
    """Where the method `rate` looks first; null: nowhere before the declared distribution. For one scenario alone."""

    on_end: Annotated[str, Field(max_length=500), AfterValidator(plain_url)] | None = Field(
        default=None, exclude_if=is_none
    )
    """URL to which the service posts state and headline failures at the end; `RISK_SAC_ON_END` allows it."""

    @model_validator(mode="after")
    def _within_reason(self) -> Self:
        runs = len(self.families) * len(self.methods) * len(self.seeds)
        drawn = len(self.families) * len(IID_METHODS) * self.iid.episodes if self.iid else 0
        if runs * self.budget.total_episodes + drawn > MOST_EPISODES:
            more = f", and {drawn} of the i.i.d. phase" if drawn else ""
            got = f"{self.budget.total_episodes} episodes for each of {runs} runs{more}"
            raise ConfigError("budget", got, f"at most {MOST_EPISODES} in all")
        return self

    @model_validator(mode="after")
    def _boundary_is_told(self) -> Self:
        if "boundary" in self.methods and self.boundary is None:
            raise ConfigError("boundary", "nothing", "`over`, the parameters that the method boundary searches")
        if "boundary" not in self.methods and self.boundary is not None:
            raise ConfigError("boundary", "it without the method boundary", remedy="add the method, or leave it out")
        return self

    @model_validator(mode="after")
    def _start_has_its_scenario(self) -> Self:
        if self.rate is not None and "rate" not in self.methods:
            raise ConfigError("rate", "it without the method rate", remedy="add the method, or leave it out")
        if self.rate is not None and len(self.families) > 1:
            raise ConfigError("rate", f"it with {len(self.families)} families", "one, whose scenes they are")
        return self

    @model_validator(mode="after")
    def _no_repeats(self) -> Self:
        for name in ("families", "methods", "seeds", "tags"):
            check_once(name, getattr(self, name))
        names = [requirement.name for requirement in self.requirements]
        if len(set(names)) < len(names):
            raise ConfigError("requirements", f"the names {names}", "each name once")
        return self

    @property
    def digest(self) -> str:
        """SHA-256 of the canonical JSON, the label included."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()

    def runs(self) -> tuple[RunSpec, ...]:
        """Returns all runs in queue order: searches, then the i.i.d. phase."""
        return self.searches() + self.drawn()

    def searches(self) -> tuple[RunSpec, ...]:
        """Returns families × methods × seeds, seeds outermost: early results compare methods."""
        return tuple(
            RunSpec(
                family=family,
                method=method,
                seed=seed,
                budget=self.budget,
                boundary=self.boundary if method == "boundary" else None,
                rate=self.rate if method == "rate" else None,
                **self._shared(),
            )
            for seed in self.seeds
            for family in self.families
            for method in self.methods
        )

    def drawn(self) -> tuple[RunSpec, ...]:
        """Returns the i.i.d. phase's runs, one per family and kind of traffic."""
        if self.iid is None:
            return ()
        budget = Budget(episodes=self.iid.episodes)
        return tuple(
            RunSpec(family=family, method=method, seed=self.iid.seed, budget=budget, **self._shared())
            for family in self.families
            for method in IID_METHODS
        )

    def _shared(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in SHARED}


SHARED = ("ego", "odd", "requirements", "learner", "judge", "prior", "deviation")  # by all runs of a campaign
MOST_BYTES = 2 * 2**30  # of a run, beside the 0.6 GB or so that any run takes for code
FLOAT, DOUBLE = 4, 8
EPISODE_BYTES = 12_000  # of a record, as an object and as text in a checkpoint
STEP_BYTES = 1500  # of a step that another process has played, beside what is observed
IN_CHECKPOINT = 3  # what lives, its copy, and the archive of it


def check_demand(spec: RunSpec, observation_size: int, action_size: int, horizon_steps: int) -> None:
    """Refuses a run above `MOST_BYTES`; the ConfigError names the largest field."""
    demand = demand_bytes(spec, observation_size, action_size, horizon_steps)
    if (total := sum(demand.values())) > MOST_BYTES:
        field, most = max(demand.items(), key=lambda item: item[1])
        raise ConfigError(
            field,
            f"{_value(spec, field)}, for which a run takes {most / 2**30:.1f} GiB of memory, and "
            f"{total / 2**30:.1f} GiB in all",
            f"at most {MOST_BYTES / 2**30:g} GiB in all",
        )


def demand_bytes(spec: RunSpec, observation_size: int, action_size: int, horizon_steps: int) -> dict[str, int]:
    """Computes a run's peak memory, by the field that asks for it.

    That is when a checkpoint is written at the run's end.

    parameters: P floats; of a network that learns 4 live (value, gradient, two moments of Adam) and 6 in a checkpoint
    (values and moments, copied and written), of a target 2 and 2.
    replay: a row for each decision of the search, up to the capacity, `IN_CHECKPOINT` times.
    batch_size: what enters and leaves each layer of four networks at once.
    batch: the steps of the episodes that are played and not told yet, of two rounds.
    """
    method, agent, batch = method_of(spec.method), spec.learner.agent, spec.budget.batch
    episodes = spec.budget.episodes
    demand = {"budget.episodes": EPISODE_BYTES * spec.budget.total_episodes}
    if not method.learns:
        return demand
    stochastic = method.stochastic
    actor = (observation_size, *agent.hidden_sizes, action_size * (2 if stochastic else 1))
    critic = (observation_size + action_size, *agent.hidden_sizes, 1)
    critics, actor_targets = (2, 0) if stochastic else (1, 1)
    floats = (10 + 4 * actor_targets) * parameters(actor) + (10 + 4) * critics * parameters(critic)
    row = FLOAT * (2 * observation_size + action_size + 5) + (4 * DOUBLE if method.replay == "rper" else 0)
    decisions = min(spec.learner.replay.capacity, episodes * math.ceil(horizon_steps / agent.decision_steps))
    return demand | {
        "learner.agent.hidden_sizes": FLOAT * floats,
        "learner.replay.capacity": IN_CHECKPOINT * row * decisions,
        "learner.agent.batch_size": FLOAT * agent.batch_size * 4 * 2 * sum(critic),
        "budget.batch": 2 * (batch if batch > 1 else 0) * horizon_steps * (FLOAT * observation_size + STEP_BYTES),
    }


def parameters(sizes: Sequence[int]) -> int:
    """Weights and biases of a perceptron with layers of these sizes."""
    return sum((fan_in + 1) * out for fan_in, out in pairwise(sizes))


def _value(spec: RunSpec, field: str) -> object:
    value: object = spec
    for name in field.split("."):
        value = getattr(value, name)
    return list(value) if isinstance(value, tuple) else value
