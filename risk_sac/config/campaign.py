"""What a user posts, and the runs it expands to.

The same `CampaignSpec` is the REST body, the CLI's YAML and the stored record.
"""

import hashlib
import re
from typing import Annotated, Self

from pydantic import Field, StringConstraints, WithJsonSchema, model_validator

from risk_sac.config.base import Settings
from risk_sac.config.ego import EgoConfig
from risk_sac.config.learner import LearnerConfig
from risk_sac.config.methods import MethodName
from risk_sac.config.odd import Odd

SHIPPED = ("low", "mixed", "dense")
PLACED = r"(car_following|crossing|junction)_[0-9a-f]{12}"
FAMILY_NAME = re.compile(rf"^({'|'.join(SHIPPED)}|{PLACED})$")
FamilyName = Annotated[
    str,
    StringConstraints(pattern=FAMILY_NAME),
    WithJsonSchema(
        {"anyOf": [{"type": "string", "enum": list(SHIPPED)}, {"type": "string", "pattern": f"^{PLACED}$"}]}
    ),
]
"""A shipped family, or a pattern at a place of a map; the digits are of the place."""
Seed = Annotated[int, Field(ge=0, le=2**31 - 1)]
MOST_EPISODES = 2_000_000  # of a campaign; the database takes about 1.2 KB for each
MOST_FAMILIES = 100  # of a campaign
Identifier = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]{0,39}$")]


class Requirement(Settings):
    """One STL requirement over the published signals; past-time operators only."""

    name: Identifier
    formula: Annotated[str, Field(min_length=1, max_length=500)]
    scale: Annotated[float, Field(ge=1e-3, le=1e6)]
    """Physical size of a clear margin, in the formula's unit; robustness is divided by it."""
    shapes: bool = True
    """Whether it counts in the soft minimum and so in the reward's shaping; if not, it is only monitored."""


class Budget(Settings):
    """What each run may spend; equal for all methods of a campaign."""

    episodes: Annotated[int, Field(ge=1, le=100_000)] = 300
    """Search episodes, rejected scenes included."""
    evaluation_episodes: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Episodes of the frozen policy after the search."""
    cpu_s: Annotated[float, Field(ge=0.1, le=1e7)] | None = None
    """Processor time after which a search ends that has episodes left, s; how many it has played then depends on the
    processor."""

    @property
    def total_episodes(self) -> int:
        """Episodes of both phases."""
        return self.episodes + self.evaluation_episodes


class RunSpec(Settings):
    """One run: the unit of scheduling, checkpoint and retry."""

    family: FamilyName
    method: MethodName
    seed: Seed
    budget: Budget = Budget()
    ego: EgoConfig = EgoConfig()
    odd: Odd = Odd()
    requirements: Annotated[tuple[Requirement, ...], Field(max_length=20)] = ()
    learner: LearnerConfig = LearnerConfig()

    @property
    def id(self) -> str:
        """Unique within its campaign."""
        return f"{self.family}-{self.method}-{self.seed}"

    @property
    def digest(self) -> str:
        """SHA-256 of the canonical JSON; two runs with the same digest give the same results."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()


class CampaignSpec(Settings):
    """Families × methods × seeds on one equal budget."""

    label: Annotated[str, Field(max_length=200)] = ""
    families: Annotated[tuple[FamilyName, ...], Field(min_length=1, max_length=MOST_FAMILIES)]
    methods: Annotated[tuple[MethodName, ...], Field(min_length=1, max_length=20)] = ("risk-sac",)
    seeds: Annotated[tuple[Seed, ...], Field(min_length=1, max_length=100)] = (0,)
    budget: Budget = Budget()
    ego: EgoConfig = EgoConfig()
    odd: Odd = Odd()
    requirements: Annotated[tuple[Requirement, ...], Field(max_length=20)] = ()
    learner: LearnerConfig = LearnerConfig()

    @model_validator(mode="after")
    def _within_reason(self) -> Self:
        runs = len(self.families) * len(self.methods) * len(self.seeds)
        if runs * self.budget.total_episodes > MOST_EPISODES:
            raise ValueError(
                f"budget is {self.budget.total_episodes} episodes for each of {runs} runs; wanted at most "
                f"{MOST_EPISODES} in all"
            )
        return self

    @model_validator(mode="after")
    def _no_repeats(self) -> Self:
        for name in ("families", "methods", "seeds"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ValueError(f"{name} is {list(values)}; wanted each value once")
        names = [requirement.name for requirement in self.requirements]
        if len(set(names)) < len(names):
            raise ValueError(f"requirements are named {names}; wanted each name once")
        return self

    @property
    def digest(self) -> str:
        """SHA-256 of the canonical JSON, the label included."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()

    def runs(self) -> tuple[RunSpec, ...]:
        """The runs in the order they are queued: seeds outermost, so that early results compare methods."""
        shared = {name: getattr(self, name) for name in ("budget", "ego", "odd", "requirements", "learner")}
        return tuple(
            RunSpec(family=family, method=method, seed=seed, **shared)
            for seed in self.seeds
            for family in self.families
            for method in self.methods
        )
