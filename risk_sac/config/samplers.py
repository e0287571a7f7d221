"""Lists the samplers that the operator has registered; a method `sampler-NAME` names one.

They are entry points of the group `risk_sac.samplers`, beside those that ship. Nothing of them is imported here.
"""

from collections.abc import Mapping
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec

from risk_sac.config.methods import METHODS, SAMPLER
from risk_sac.errors import ConfigError, did_you_mean

GROUP = "risk_sac.samplers"
# Name → class, and the package that it needs.
SHIPPED: Mapping[str, tuple[str, str]] = {
    "cma-es": ("risk_sac.lab.peers:CmaEs", "cma"),
    "cross-entropy": ("risk_sac.lab.peers:CrossEntropy", ""),
    "nsga2": ("risk_sac.lab.peers:Nsga2", "pymoo"),
    "tpe": ("risk_sac.lab.peers:Tpe", "optuna"),
    "uniform": ("risk_sac.lab.peers:Uniform", ""),
}


def samplers() -> Mapping[str, EntryPoint]:
    """Returns the samplers that can be named, by name.

    Raises:
      ConfigError: two have the same name.
    """
    points = {
        name: EntryPoint(name=name, value=value, group=GROUP)
        for name, (value, package) in SHIPPED.items()
        if not package or find_spec(package)
    }
    for point in entry_points(group=GROUP):
        if points.setdefault(point.name, point).value != point.value:
            raise ConfigError(GROUP, f"two samplers as {point.name!r}", "names of their own")
    return points


def named_methods() -> tuple[str, ...]:
    """Returns the methods that a campaign can name, those of registered samplers last."""
    return (*METHODS, *(f"{SAMPLER}{name}" for name in sorted(samplers())))


def sampler_of(method: str) -> EntryPoint:
    """Returns the sampler that a method `sampler-NAME` names.

    Raises:
      ConfigError: there is none of that name, or its package is missing.
    """
    name, known = method.removeprefix(SAMPLER), samplers()
    if name in known:
        return known[name]
    if name in SHIPPED:
        remedy = "pip install 'risk-sac[peers]', for the service and its workers"
        raise ConfigError("methods", f"{method!r}, which needs {SHIPPED[name][1]}", remedy=remedy)
    registered = sorted(f"{SAMPLER}{each}" for each in known)
    remedy = did_you_mean(method, registered) or "risk_sac/search/samplers.md says how to register another"
    raise ConfigError("methods", f"{method!r}", f"one of {', '.join(registered)}, which are registered", remedy)
