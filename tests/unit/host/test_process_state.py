"""Foreign code changes its process's state for itself, not for us."""

import gc
import io
import locale
import logging
import os
import signal
import socket
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from risk_sac.host.process_state import TINY, Preserved, preserved


def reset_signal() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a start in the background ignores SIGINT already


def replace_streams() -> None:
    sys.stdout = sys.stderr = io.StringIO()


QUICK: dict[str, tuple[Callable[[], Any], Callable[[], Any]]] = {
    "folder": (lambda: os.chdir("/"), os.getcwd),
    "signals": (reset_signal, lambda: signal.getsignal(signal.SIGTERM)),
    "locale": (lambda: locale.setlocale(locale.LC_CTYPE, "C"), lambda: locale.setlocale(locale.LC_ALL)),
    "warnings": (lambda: warnings.simplefilter("error"), lambda: list(warnings.filters)),
    "arithmetic": (lambda: np.seterr(all="raise"), np.geterr),
    "dtype": (lambda: torch.set_default_dtype(torch.float64), torch.get_default_dtype),
    "gradients": (lambda: torch.set_grad_enabled(False), torch.is_grad_enabled),
    "threads": (lambda: torch.set_num_threads(3), torch.get_num_threads),
    "deterministic": (lambda: torch.use_deterministic_algorithms(True), torch.are_deterministic_algorithms_enabled),
    "denormals": (lambda: torch.set_flush_denormal(True), lambda: TINY * 1.0 == 0.0),
    "umask": (lambda: os.umask(0o777), lambda: (os.umask(mask := os.umask(0o22)), mask)[1]),
    "modules": (sys.path.clear, lambda: list(sys.path)),
    "streams": (replace_streams, lambda: (sys.stdout, sys.stderr)),
    "recursion": (lambda: sys.setrecursionlimit(700), sys.getrecursionlimit),
    "garbage": (gc.disable, gc.isenabled),
    "timeout": (lambda: socket.setdefaulttimeout(0.001), socket.getdefaulttimeout),
    "logging": (lambda: logging.disable(), lambda: logging.root.manager.disable),
}
OTHERS: dict[str, tuple[Callable[[], Any], Callable[[], Any]]] = {
    "environment": (lambda: os.environ.update(HOME="/nowhere", TZ="Mars"), lambda: dict(os.environ)),
    "print options": (lambda: np.set_printoptions(precision=1), np.get_printoptions),
    "blocked": (
        lambda: signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM]),
        lambda: signal.pthread_sigmask(signal.SIG_BLOCK, ()),
    ),
    "device": (lambda: torch.set_default_device("meta"), torch.get_default_device),
}


@pytest.mark.parametrize("name", [*QUICK, *OTHERS])
def test_what_foreign_code_changes_holds_for_it_and_not_for_us(name):
    change, read = (QUICK | OTHERS)[name]
    state: Preserved = preserved()
    block = state.quick if name in QUICK else state
    before = read()
    with block:
        change()
        theirs = read()
    assert theirs != before
    assert read() == before
    with block:
        assert read() == theirs
    assert read() == before


@pytest.mark.parametrize("name", OTHERS)
def test_what_a_quick_block_overlooks_is_put_right_at_the_next_block_of_all(name):
    change, read = OTHERS[name]
    state, before = preserved(), read()
    with state:
        pass
    with state.quick:
        change()
    theirs = read()
    with state:
        assert read() == theirs != before
    assert read() == before


def test_what_it_puts_back_is_forgotten_and_an_error_passes(tmp_path):
    state, here = preserved(), os.getcwd()
    with pytest.raises(SystemExit), state:
        sys.exit(os.chdir(tmp_path))
    assert os.getcwd() == here
    with state:
        os.chdir(here)
    os.chdir(tmp_path)
    try:
        with state:
            assert Path.cwd() == tmp_path
    finally:
        os.chdir(here)


def test_a_process_that_foreign_code_forks_does_not_come_back():
    with preserved().quick:
        child = os.fork()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1


def test_a_thread_that_never_ends_does_not_keep_the_process():
    program = (
        "import threading, time; from risk_sac.host.process_state import leave; "
        "threading.Thread(target=time.sleep, args=(600,)).start(); print('done'); leave(3)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (3, "done\n"), done.stderr


def test_a_process_ends_without_a_search_for_garbage():
    program = (
        "import atexit, gc; from risk_sac.host.process_state import leave; "
        "atexit.register(lambda: print(gc.get_freeze_count() > 0, len(gc.get_objects()))); leave(0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    frozen, left = done.stdout.split()
    assert frozen == "True"
    assert int(left) < 1000


def test_a_folder_that_is_gone_is_no_error(tmp_path):
    here, gone = os.getcwd(), tmp_path / "gone"
    gone.mkdir()
    os.chdir(gone)
    try:
        with preserved():
            gone.rmdir()
        with preserved():
            os.chdir(here)
    finally:
        os.chdir(here)
