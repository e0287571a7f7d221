"""What a run's results depend on; it has to be the same on the server's machine and on all nodes."""

import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

from risk_sac.egos.registry import installed

PACKAGES = ("risk-sac", "ray", "libsumo", "torch", "botorch", "gpytorch", "rtamt", "numpy")
MISSING = "missing"

Versions = Mapping[str, str]


def versions() -> Versions:
    """Of Python, of packages, and of the egos that are installed, on this machine."""
    found = {"python": ".".join(map(str, sys.version_info[:3]))}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = MISSING
    return found | {f"the ego {name}": version for name, version in installed().items()}


def differing(found: Versions, expected: Versions) -> str:
    """Which of those that the server's machine has are of another version here, in words; empty if none is.

    An ego that is installed here alone is no difference: no campaign can name it.
    """
    other = [
        f"{name} is {found.get(name, MISSING)}; wanted {wanted}"
        for name, wanted in expected.items()
        if found.get(name, MISSING) != wanted
    ]
    return f"{', '.join(other)}, as on the server's machine" if other else ""
