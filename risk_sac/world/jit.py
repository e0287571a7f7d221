"""Compilation of the per-step measures.

A step of a small SUMO scene takes some 50 µs, less than a dozen numpy calls on five actors; compiled loops
keep the measures from costing several times the simulation.
"""

import hashlib
import re
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event

from risk_sac.host.machine import user_cache

Function = TypeVar("Function", bound=Callable[..., Any])
SETTINGS = vars(numba.config)
PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(r"^ *from risk_sac\.([\w.]+) import", re.MULTILINE)


def _sources() -> dict[Path, str]:
    """Returns the files with compiled functions, and all that these import.

    Functions and constants of the imports are compiled into them.
    """
    texts = {path: path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")}
    sources: dict[Path, str] = {}
    pending = [path for path, text in texts.items() if "@compiled" in text]
    while pending:
        path = pending.pop()
        if path in sources or path not in texts:
            continue
        sources[path] = texts[path]
        for name in IMPORT.findall(texts[path]):
            module = PACKAGE.joinpath(*name.split("."))
            pending += [module.with_suffix(".py"), module / "__init__.py"]
    return sources


def _cache_folder() -> str:
    """Returns the compiled code's folder for the present sources; empty if unwritable.

    numba looks at a function's own file only: after a change in a file whose functions it calls, the function would be
    taken from disk with the old ones in it. The folders that it chooses by itself are not named by a digest either.
    """
    digest = hashlib.sha256()
    for _, text in sorted(_sources().items()):
        digest.update(text.encode())
    cache = user_cache()
    own = [PACKAGE / "__pycache__"] if cache is None else [PACKAGE / "__pycache__", cache / "risk-sac" / "compiled"]
    for place in [Path(SETTINGS["CACHE_DIR"])] if SETTINGS["CACHE_DIR"] else own:
        folder = place.absolute() / digest.hexdigest()[:16]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return str(folder)
    return ""


SETTINGS["CACHE_DIR"] = _cache_folder()


class _Compilation(event.Listener):
    """Listener that counts processor time of compilation, once for nested functions."""

    def __init__(self) -> None:
        self.spent_s = 0.0
        self._depth = 0
        self._began_s = 0.0

    def on_start(self, event: event.Event) -> None:
        """Begins to count, unless that is done already."""
        if self._depth == 0:
            self._began_s = time.process_time()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        """Counts."""
        self._depth -= 1
        if self._depth == 0:
            self.spent_s += time.process_time() - self._began_s


_COMPILATION = _Compilation()
event.register("numba:compile", _COMPILATION)  # type: ignore[no-untyped-call]


def cpu_s() -> float:
    """Returns this process's processor time without that of compilation, s."""
    return time.process_time() - _COMPILATION.spent_s


def compiled(function: Function) -> Function:
    """Compiles on first call, and keeps the result on disk."""
    return cast(Function, numba.njit(cache=bool(SETTINGS["CACHE_DIR"]))(function))
