"""Names the settings that a family or an ego does not support as they are written."""

from collections.abc import Iterator
from typing import Any

from risk_sac.config import CampaignSpec, EgoConfig, Interval, Odd, RunSpec
from risk_sac.errors import ConfigError
from risk_sac.records import Adjustment
from risk_sac.scenario.environment import VISIBILITY, with_environment
from risk_sac.scenario.families import family_named
from risk_sac.scenario.family import Family
from risk_sac.scenario.odd import TINY, field, intersect, narrow, paths, requirements_from_odd, text_of, widest


def adjustments(spec: RunSpec | CampaignSpec) -> tuple[Adjustment, ...]:
    """Compares what a spec asks of each family with what its episodes use.

    A family that cannot be read any more, such as a place that the library has lost, is left out.
    """
    found: dict[Adjustment, list[str]] = {}
    for name in (spec.family,) if isinstance(spec, RunSpec) else spec.families:
        try:
            for each in _of_family(family_named(name), spec):
                found.setdefault(each, []).append(name)
        except ConfigError:
            continue
    return tuple(each.model_copy(update={"families": tuple(names)}) for each, names in found.items())


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
    shipped = {each.name for each in requirements_from_odd(whole, ego.response_s)}
    for i, requirement in enumerate(spec.requirements):
        if not requirement.formula and requirement.name not in shipped:
            why = f"there is no {requirement.name}"
            yield Adjustment(families=(), field=f"requirements[{i}]", asked=requirement.counts, used="nothing", why=why)


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
