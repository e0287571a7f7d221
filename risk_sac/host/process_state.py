"""Process-wide settings, such as the locale, kept apart for foreign code.

    state = Preserved()
    with state:             # while it is imported, made, begun, closed
        ego = make_ego()
    with state.quick:       # while it answers: some microseconds, and the rarer settings are not looked at
        ego.act(perceived)

What foreign code changes holds again when it runs next, and never for us. A process that it forks ends where it would
come back to us, since it would write the same files. Random state is not kept, because nothing of
ours draws from a generator that is shared.
"""

import contextlib
import gc
import locale
import logging
import os
import signal
import socket
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from types import TracebackType
from typing import Any, NamedTuple, NoReturn, ParamSpec, Self, TypeVar

import numpy as np

try:
    # `signal.getsignal` looks for an enumeration's member, which takes nearly all of its time.
    from _signal import getsignal as handler_of  # type: ignore[import-not-found,unused-ignore]
except ImportError:
    from signal import getsignal as handler_of

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")
SIGNALS = (signal.SIGINT, signal.SIGTERM)
TINY = 5e-324  # is 0 where a library has told the processor to flush such numbers
_INITIAL_TORCH = ("float32", True, 1, False)


class Setting(NamedTuple):
    """Reader and writer of a setting."""

    read: Callable[[], Any]
    set: Callable[[Any], object]


def collect_seldom() -> None:
    """Collects garbage seldom, as modules and episodes last and have few cycles."""
    gc.set_threshold(50_000)


def leave(status: int) -> NoReturn:
    """End this process, whatever threads foreign code has left at work."""
    gc.freeze()  # else Python searches for garbage as it ends, half a second with the simulator loaded
    if all(thread.daemon or thread is threading.main_thread() for thread in threading.enumerate()):
        sys.exit(status)
    logging.shutdown()
    for stream in filter(None, (sys.stdout, sys.stderr)):
        stream.flush()
    os._exit(status)  # Python would wait for them


def c_numbers(function: Callable[Arguments, Answer]) -> Callable[Arguments, Answer]:
    """Makes a function read and write numbers in libsumo's C locale."""

    @wraps(function)
    def in_c_locale(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        ours = locale.setlocale(locale.LC_NUMERIC)
        if ours == "C":
            return function(*args, **kwargs)
        locale.setlocale(locale.LC_NUMERIC, "C")
        try:
            return function(*args, **kwargs)
        finally:
            locale.setlocale(locale.LC_NUMERIC, ours)

    return in_c_locale


def preserved() -> "Preserved":
    """State of foreign code that has changed nothing yet."""
    return Preserved()


class _Swap:
    """Context manager that exchanges some settings for those of the foreign code."""

    def __init__(self, settings: Sequence[Setting], theirs: dict[Setting, Any]) -> None:
        self._settings, self._theirs = settings, theirs
        self._ours: list[Any] = []
        self._process = 0

    def __enter__(self) -> Self:
        self._process = os.getpid()
        self._ours = [setting.read() for setting in self._settings]
        for setting, value in self._theirs.items():
            if setting in self._settings:
                setting.set(value)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if os.getpid() != self._process:
            os._exit(1)
        now = [setting.read() for setting in self._settings]
        if now == self._ours and not self._theirs:
            return
        for setting, ours, left in zip(self._settings, self._ours, now, strict=True):
            if left != ours:
                self._theirs[setting] = left
                setting.set(ours)
            elif setting in self._theirs:
                del self._theirs[setting]


class Preserved(_Swap):
    """Exchange of all settings; `quick` exchanges those that cost little to read.

    Foreign code changes the quick ones most.
    What a `quick` block has changed of the others is put right when the next block of all begins.
    """

    def __init__(self) -> None:
        theirs: dict[Setting, Any] = {}
        super().__init__((*QUICK, *OTHERS), theirs)
        self.quick = _Swap(QUICK, theirs)
        self._left: dict[Setting, Any] = {}  # the others' values after the latest block of all

    def __enter__(self) -> Self:
        for setting, ours in self._left.items():
            now = setting.read()
            if now != ours:
                self._theirs[setting] = now
                setting.set(ours)
        return super().__enter__()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        super().__exit__(kind, error, trace)
        self._left = {setting: setting.read() for setting in OTHERS}


def _folder() -> str | None:
    try:
        return os.getcwd()
    except FileNotFoundError:  # it was deleted
        return None


def _enter(folder: str | None) -> None:
    with contextlib.suppress(OSError):  # it may be gone by now
        os.chdir(folder or ".")


def _handlers() -> tuple[Any, ...]:
    return tuple(map(handler_of, SIGNALS))


def _handle(handlers: Sequence[Any]) -> None:
    if threading.current_thread() is not threading.main_thread():
        return  # where none could have been set, either
    for number, handler in zip(SIGNALS, handlers, strict=True):
        if handler is not None:  # None: it was not set from Python
            signal.signal(number, handler)


def _filter(filters: Sequence[Any]) -> None:
    warnings.resetwarnings()  # so that Python forgets what it has decided by the old ones
    warnings.filters[:] = filters  # type: ignore[index]


def _torch() -> Any:
    torch = sys.modules.get("torch")
    if torch is None:
        return None
    return (
        str(torch.get_default_dtype()).removeprefix("torch."),
        torch.is_grad_enabled(),
        torch.get_num_threads(),
        torch.are_deterministic_algorithms_enabled(),
    )


def _set_torch(values: Any) -> None:
    torch = sys.modules["torch"]
    dtype, gradients, threads, deterministic = values or _INITIAL_TORCH
    torch.set_default_dtype(getattr(torch, dtype))
    torch.set_grad_enabled(gradients)
    torch.set_num_threads(threads)
    torch.use_deterministic_algorithms(deterministic)


def _device() -> Any:
    torch = sys.modules.get("torch")
    return None if torch is None else torch.get_default_device()


def _flush(flushed: bool) -> None:
    if "torch" in sys.modules:  # else there is no way to say it
        sys.modules["torch"].set_flush_denormal(flushed)


def _streams() -> tuple[Any, ...]:
    return sys.stdin, sys.stdout, sys.stderr


def _set_streams(streams: tuple[Any, ...]) -> None:
    sys.stdin, sys.stdout, sys.stderr = streams


def _set_path(folders: Sequence[str]) -> None:
    sys.path[:] = folders


def _set_environment(wanted: dict[str, str]) -> None:
    for name in os.environ.keys() - wanted.keys():
        del os.environ[name]
    os.environ.update(wanted)


def _umask() -> int:
    umask = os.umask(0o77)
    os.umask(umask)
    return umask


QUICK = (
    Setting(_folder, _enter),
    Setting(lambda: locale.setlocale(locale.LC_ALL), lambda name: locale.setlocale(locale.LC_ALL, name)),
    Setting(_handlers, _handle),
    Setting(lambda: tuple(warnings.filters), _filter),
    Setting(np.geterr, lambda modes: np.seterr(**modes)),
    Setting(_torch, _set_torch),
    Setting(lambda: TINY * 1.0 == 0.0, _flush),
    Setting(_streams, _set_streams),
    Setting(_umask, os.umask),
    Setting(lambda: tuple(sys.path), _set_path),
    Setting(sys.getrecursionlimit, sys.setrecursionlimit),
    Setting(gc.isenabled, lambda enabled: gc.enable() if enabled else gc.disable()),
    Setting(socket.getdefaulttimeout, socket.setdefaulttimeout),
    Setting(lambda: logging.root.level, logging.root.setLevel),
    Setting(lambda: logging.root.manager.disable, logging.disable),
)
OTHERS = (
    Setting(lambda: dict(os.environ), _set_environment),
    Setting(np.get_printoptions, lambda options: np.set_printoptions(**options)),
    Setting(
        lambda: signal.pthread_sigmask(signal.SIG_BLOCK, ()),
        lambda mask: signal.pthread_sigmask(signal.SIG_SETMASK, mask),
    ),
    Setting(_device, lambda device: sys.modules["torch"].set_default_device(device)),
)
