"""Poses a run's problem, and names its settings not supported as written."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from risk_sac.config import CampaignSpec, EgoConfig, Interval, JudgeConfig, Odd, Requirement, RunSpec
from risk_sac.config.campaign import check_demand
from risk_sac.config.methods import SAMPLER, MethodName, method_of, sampler_of
from risk_sac.egos.registry import pinned
from risk_sac.env.observation_layout import observation_size
from risk_sac.errors import ConfigError, OddError, did_you_mean
from risk_sac.host.machine import check_batch
from risk_sac.records import NO_CONTACT, Adjustment
from risk_sac.risk.requirements import SHIPPED_REQUIREMENTS, requirements_from_odd
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.risk.stl import parsed
from risk_sac.scenario.declared import SceneLaw, Slice
from risk_sac.scenario.families import Family, family_named
from risk_sac.scenario.limits import GRAVITY_MPS2, VISIBILITY, limits_from_odd, with_environment
from risk_sac.scenario.odd import (
    TINY,
    field,
    intersect,
    narrow,
    paths,
    text_of,
    widest,
)
from risk_sac.scenario.space import DEFAULT_LEVELS, Grid, SceneSpace, grid_of
from risk_sac.world.types import STEP_S


def adjustments(spec: RunSpec | CampaignSpec) -> tuple[Adjustment, ...]:
    """Compares what a spec asks of families with what their episodes use.

    A family that cannot be read any more, such as a place that the library has lost, is left out.
    """
    families_by_adjustment: dict[Adjustment, list[str]] = {}
    for name in (spec.family,) if isinstance(spec, RunSpec) else spec.families:
        try:
            for each in _of_family(family_named(name, spec.deviation), spec):
                families_by_adjustment.setdefault(each, []).append(name)
        except ConfigError:
            continue
    return tuple(each.model_copy(update={"families": tuple(names)}) for each, names in families_by_adjustment.items())


def _of_family(family: Family, spec: RunSpec | CampaignSpec) -> Iterator[Adjustment]:
    odd, ego = spec.odd, spec.ego
    whole, supported = intersect(family.odd, odd), widest(family.odd)
    space = narrow(with_environment(family.space, odd, whole), whole)
    for path in paths(odd):
        asked, used = field(odd, path), field(whole, path)
        if asked is None:
            continue
        if used != asked:
            limit = field(supported, path)
            why = f"the family supports {text_of(limit)}" if _beyond(asked, limit) else "other fields bound it"
            yield _adjusted(path, asked, used, why)
        for parameter in space.parameters:
            bounds = Interval(low=parameter.low, high=parameter.high)
            if parameter.odd == path and isinstance(used, Interval) and _beyond(used, bounds):
                yield _adjusted(path, used, bounds, f"scenes begin with {parameter.name} in {text_of(bounds)}")
    yield from _of_sensor(whole, ego, stated=VISIBILITY in space.names)
    methods = (spec.method,) if isinstance(spec, RunSpec) else spec.methods
    if any(method_of(method).scenes == "grid" for method in methods):
        undisturbed = narrow(with_environment(family.undisturbed.space, odd, whole), whole)
        grid = grid_of(undisturbed, family.parameters)
        yield from _of_grid(grid, spec.budget.episodes)
    shipped = {each.name for each in requirements_from_odd(whole, ego.response_s)}
    for i, requirement in enumerate(spec.requirements):
        if not requirement.formula and requirement.name not in shipped:
            why = f"there is no {requirement.name}"
            yield Adjustment(families=(), field=f"requirements[{i}]", asked=requirement.counts, used="nothing", why=why)


def _of_grid(grid: Grid, episodes: int) -> Iterator[Adjustment]:
    """Adjustments of a sweep: values that the scenario leaves open, and sampling."""
    for name in grid.unstated:
        why = "the scenario states no step"
        yield Adjustment(
            families=(), field=f"parameters.{name}.step", asked="none", used=f"{DEFAULT_LEVELS} values", why=why
        )
    if grid.size > episodes:
        points = f"{grid.size:,} points"
        why = "the budget's episodes are fewer; the sample is stratified"
        yield Adjustment(families=(), field="budget.episodes", asked=points, used=f"{episodes:,} of them", why=why)


def _of_sensor(odd: Odd, ego: EgoConfig, *, stated: bool) -> Iterator[Adjustment]:
    visibility = odd.environment.visibility_m
    if ego.sensor is None or visibility is None:
        return
    range_m = ego.sensor.range_m
    if stated and range_m < visibility.high:
        effect = "nothing changes" if range_m <= visibility.low else f"nothing changes from {range_m:g} m on"
        used = Interval(low=min(range_m, visibility.low), high=range_m)
        yield _adjusted("environment.visibility_m", visibility, used, f"the ego's sensor sees {range_m:g} m: {effect}")
    if not stated and range_m > visibility.low:
        why = "the family's default visibility begins there; state odd.environment.visibility_m to change it"
        got, used_m = f"{range_m:g}", f"{visibility.low:g}"
        yield Adjustment(families=(), field="ego.sensor.range_m", asked=got, used=used_m, why=why)


def _beyond(asked: Any, limit: Any) -> bool:
    """Whether something is asked for outside the limit."""
    if isinstance(asked, Interval):
        return bool(asked.low < limit.low - TINY or asked.high > limit.high + TINY)
    return bool(set(asked) - set(limit))


def _adjusted(path: str, asked: Any, used: Any, why: str) -> Adjustment:
    return Adjustment(families=(), field=f"odd.{path}", asked=text_of(asked), used=text_of(used), why=why)


RSS_RESPONSE_S = 0.5  # response time of any ego: a slower driver makes a scene neither less dangerous nor less fair
RSS_BRAKING_MPS2 = 6.0  # firm braking of a driver whose car could brake with 8 m/s² and more
SUMO_KEEPS = frozenset({"on_carriageway", "no_red_light_entry"})  # requirements that SUMO's own driver never violates


@dataclass(frozen=True, slots=True)
class Problem:
    """Constants of all episodes of a run."""

    family: Family
    odd: Odd  # complete: the family's default narrowed by the user's
    space: SceneSpace  # the family's, narrowed by the ODD, with the parameters of a user's environment
    ego: EgoConfig
    requirements: tuple[Requirement, ...]  # the ODD's, then the user's
    rss: RssParameters
    drivers: tuple[str, ...]  # reference drivers whose word makes a failure preventable

    @classmethod
    def from_spec(cls, spec: RunSpec, family: Family | None = None) -> "Problem":
        """Translates a run's settings.

        Args:
          spec: of the run.
          family: that it plays, where the spec's has no name in a library.

        Raises:
          OddError: the ODD contradicts itself or leaves no scene.
          FormulaError: a user's requirement cannot be monitored online.
          ConfigError: a user's requirement has a shipped one's name and a formula, or neither; the ego is not
            registered or in another version; or the run takes too much memory.
        """
        ego = pinned(spec.ego)
        family = family or family_named(spec.family, spec.deviation)
        if method_of(spec.method).agent == "none":
            family = family.undisturbed
        odd = intersect(family.odd, spec.odd, family.space)
        if missing := set(family.odd.dynamic.actor_kinds or ()) - set(odd.dynamic.actor_kinds or ()):
            raise OddError(
                "odd.dynamic.actor_kinds",
                f"{list(odd.dynamic.actor_kinds or ())}",
                f"{sorted(missing)} too, which every scene of the {family.name!r} family has",
            )
        judge = spec.judge if family.judge is None or spec.judge != JudgeConfig() else family.judge
        problem = cls(
            family=family,
            odd=odd,
            space=narrow(with_environment(family.space, spec.odd, odd), odd),
            ego=ego,
            requirements=_requirements(spec, family, odd, ego),
            rss=_rss_parameters(odd),
            drivers=judge.drivers,
        )
        problem.check_demand(spec)
        problem.check_grid(spec)
        problem.check_distributions(spec)
        problem.check_boundary(spec)
        return problem

    def check_demand(self, spec: RunSpec) -> None:
        """Refuses a run of this problem that would take too much memory.

        Raises:
          ConfigError: naming the field that takes most of it.
        """
        check_demand(spec, self.observation_size, self.action_size, self.family.horizon_steps)

    def check_grid(self, spec: RunSpec) -> None:
        """Refuses a sweep of all points if the grid exceeds the budget.

        Raises:
          ConfigError: with the size of the grid.
        """
        if method_of(spec.method).scenes != "grid":
            return
        size = self.grid.size
        if spec.budget.all_points and size > spec.budget.episodes:
            got = f"true, for a grid of {size:,} points"
            wanted = f"at most {spec.budget.episodes:,}, the budget's episodes"
            raise ConfigError("budget.all_points", got, wanted, "leave it out, and a stratified sample is played")

    def check_distributions(self, spec: RunSpec) -> None:
        """Refuses a run whose declared distribution has no mass in the ODD.

        Raises:
          ConfigError: naming its parameter, or that no scene which it starts from is in the ODD.
        """
        if method_of(spec.method).scenes not in ("iid", "rate"):
            return
        declared = self.declared
        if spec.rate is not None and not len(declared.normals(spec.rate.scenes)):
            named = ", ".join(self.space.names)
            raise ConfigError("rate.scenes", "no scene within the ODD", f"values of {named} within their ranges")

    @property
    def declared(self) -> SceneLaw:
        """The declared distribution of its scenes; see `SceneLaw.of`."""
        return SceneLaw.of(self.space, self.family.parameters, self.family.rank_correlation)

    def slice_of(self, spec: RunSpec) -> Slice:
        """Returns the slice of scene space whose boundary a run seeks."""
        if spec.boundary is None:
            raise ConfigError("boundary", "nothing", "the parameters `over` which the method boundary searches")
        return Slice(self.space, spec.boundary, self.family.parameters)

    def check_boundary(self, spec: RunSpec) -> None:
        """Refuses a boundary search over what has no boundary.

        Raises:
          ConfigError: it names a parameter or requirement that there is not, or a parameter without a range.
        """
        if method_of(spec.method).scenes != "boundary":
            return
        searched = self.slice_of(spec)
        searched.check()
        known = [each.name for each in self.requirements if each.counts == "failure"]
        wanted = searched.config.requirement
        if wanted and wanted not in known:
            hint = did_you_mean(wanted, known)
            raise ConfigError("boundary.requirement", repr(wanted), f"one of {', '.join(known)}", hint)

    @property
    def grid(self) -> Grid:
        """The grid of its scene space."""
        return grid_of(self.space, self.family.parameters)

    @property
    def observation_size(self) -> int:
        """Entries of an observation."""
        return observation_size(
            len(self.family.adversaries), self.space.dimension, len(self.requirements), len(self.family.statics)
        )

    @property
    def action_size(self) -> int:
        """Entries of a joint action: drive and steering of each adversary."""
        return 2 * len(self.family.adversaries)

    @property
    def contact_alone_counts(self) -> bool:
        """Whether the ego can fail by contacts alone.

        SUMO's driver leaves no road and enters no junction on red.
        """
        counting = {each.name for each in self.requirements if each.counts == "failure"}
        return self.ego.driver is None and not self.ego.defects and counting <= SUMO_KEEPS | {NO_CONTACT}

    @property
    def speed_limit_mps(self) -> float:
        """The posted limit; all roads of a family have the same."""
        limit = self.odd.scenery.speed_limit_mps
        return float("inf") if limit is None else limit.high


def requirements_of(spec: CampaignSpec) -> Mapping[str, tuple[Requirement, ...]]:
    """Returns the requirements that each scenario of a campaign is monitored by.

    A scenario that cannot be read any more is left out. An ego that is not registered here has the response time that
    the spec states.
    """
    try:
        ego = pinned(spec.ego)
    except ConfigError:
        ego = spec.ego
    requirements: dict[str, tuple[Requirement, ...]] = {}
    for name in spec.families:
        try:
            family = family_named(name)
            requirements[name] = _requirements(spec, family, intersect(family.odd, spec.odd, family.space), ego)
        except ConfigError:
            continue
    return requirements


def _requirements(spec: RunSpec | CampaignSpec, family: Family, odd: Odd, ego: EgoConfig) -> tuple[Requirement, ...]:
    """Joins requirements of an ODD, a scenario and a user; raises `ConfigError`."""
    shipped = {each.name: each for each in requirements_from_odd(odd, ego.response_s)}
    own = {}
    for source, requirements in (("scenario.", family.requirements), ("", spec.requirements)):
        for i, requirement in enumerate(requirements):
            wanted = _own(f"{source}requirements[{i}]", requirement, shipped)
            if wanted is not None:
                parsed(i, wanted, STEP_S, family.horizon_steps)
                own[wanted.name] = wanted
    return tuple((shipped | own).values())


def _own(field: str, requirement: Requirement, shipped: Mapping[str, Requirement]) -> Requirement | None:
    """Returns a user's requirement as a run monitors it.

    One without a formula changes what the shipped requirement of its name counts as; None if this ODD has none.
    """
    name = requirement.name
    if name not in shipped:
        if not requirement.formula:
            if name in SHIPPED_REQUIREMENTS:
                return None
            raise ConfigError(f"{field}.formula", "none", f"one, or a shipped requirement's name: {', '.join(shipped)}")
        return requirement
    if requirement.formula:
        remedy = "leave its formula out to change what it counts as, or choose another name"
        raise ConfigError(f"{field}.name", f"{name!r}, which a shipped requirement has", remedy=remedy)
    if name == NO_CONTACT and requirement.counts == "report":
        raise ConfigError(f"{field}.counts", "'report'", f"'failure': a contact ends the episode, so {name} counts")
    return shipped[name].model_copy(update={"counts": requirement.counts})


def _rss_parameters(odd: Odd) -> RssParameters:
    """Returns the parameters of RSS under an ODD.

    They are a driver's delay, the braking that others can rely on, and the braking to be expected of others.

    Choice: both are RSS_BRAKING_MPS2 or the worst grip of the road that all share. SUMO's drivers keep a headway of 1 s
    and trust the one ahead to brake no harder than they do themselves; that they stop by 4.5 m/s² behind a
    leader that brakes at 8 m/s² would make all of ordinary following dangerous.
    """
    friction = odd.environment.friction
    limits = limits_from_odd(odd, friction.low if friction else 1.0)
    grip = friction.low * GRAVITY_MPS2 if friction else GRAVITY_MPS2
    return RssParameters(
        response_s=RSS_RESPONSE_S,
        brake_min_mps2=min(RSS_BRAKING_MPS2, grip),
        brake_max_mps2=min(RSS_BRAKING_MPS2, limits.brake_mps2),
    )


def checked_campaign(spec: CampaignSpec) -> CampaignSpec:
    """Returns a campaign to store, with the version of its ego.

    Refuses one that could not run; see `Problem.from_spec` and `check_installed` for the errors.
    """
    spec = spec.model_copy(update={"ego": pinned(spec.ego)})
    check_batch(spec.budget.batch)
    for method in spec.methods:
        check_installed(method)
    alike = spec.model_copy(update={"seeds": spec.seeds[:1]}).runs()  # the i.i.d. phase's among them
    for number, family in enumerate(spec.families):
        try:
            family_named(family, spec.deviation)
        except ConfigError as error:
            field = f"families[{number}]" if error.field == "family" else error.field
            raise ConfigError(field, error.got, error.expected, error.remedy) from error
        first, *others = (run for run in alike if run.family == family)
        problem = Problem.from_spec(first)
        for run in others:
            problem.check_demand(run)
            problem.check_grid(run)
            problem.check_distributions(run)
            problem.check_boundary(run)
    return spec


def check_installed(method: MethodName) -> None:
    """Refuses a method whose package or sampler is not there.

    Raises:
      ConfigError: naming it.
    """
    if method.startswith(SAMPLER):
        sampler_of(method)
    needed = method_of(method).needs
    if needed and find_spec(needed) is None:
        raise ConfigError("methods", f"{method!r}, which needs {needed}", remedy="pip install 'risk-sac[peers]'")
