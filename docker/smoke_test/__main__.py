"""Builds the image, runs it, runs the service on a cluster, and says in one line whether all does what it should."""

import argparse
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from smoke_test import cluster, image
from smoke_test.engines import NAMES, Engine, engines, no_engine
from smoke_test.errors import NoEngineError, SmokeError
from smoke_test.namespaces import delete, end_processes, own_processes
from smoke_test.story import Story

INTERRUPTED = 130
UNTRIED = 3  # exit status where no engine works, so that it cannot be taken for a pass or a failure of the image


def main() -> int:
    """Returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="docker/smoke", description=__doc__, epilog=f"Exit status: 0 passed, 1 failed, {UNTRIED} no engine."
    )
    parser.add_argument("--engine", choices=NAMES, help="only this one (default: the first that works)")
    parser.add_argument(
        "--only", choices=CASES, action="append", help="image: the image; cluster: two nodes of a Ray cluster"
    )
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    own_processes()
    folder = Path(tempfile.mkdtemp(prefix="risk-sac-smoke-"))
    try:
        told = [CASES[name](folder, options) for name in options.only or CASES]
        print(f"smoke PASSED: {'; '.join(told)}")
    except NoEngineError as error:
        print(f"smoke NOT RUN: {error}")
        return UNTRIED
    except (SmokeError, OSError, subprocess.SubprocessError) as error:
        print(f"smoke FAILED: {error}")
        return 1
    except KeyboardInterrupt:
        print("smoke STOPPED before its end")
        return INTERRUPTED
    finally:
        end_processes()
        delete(folder)
    return 0


def _image(folder: Path, options: argparse.Namespace) -> str:
    start = time.monotonic()
    engine, base = _working_engine(folder, options.engine)
    print(f"smoke: {engine.name} builds on {base}")
    image.build(engine, base, folder)
    built = time.monotonic()
    try:
        told = Story(engine, folder).told()
    finally:
        if not engine.private:  # what is private goes with the folder
            engine.attempt("image", "rm", "--force", image.IMAGE, image.STAND_IN)
    took = f"{time.monotonic() - built:.0f} s after a build of {built - start:.0f} s"
    return f"{told}; {took}"


def _cluster(folder: Path, options: argparse.Namespace) -> str:
    start = time.monotonic()
    try:
        cluster.check_possible()
    except NoEngineError as error:
        if options.only:
            raise
        return f"the cluster was left out: {error}"
    return f"{cluster.ClusterStory(folder).told()}; {time.monotonic() - start:.0f} s"


CASES = {"image": _image, "cluster": _cluster}


def _working_engine(folder: Path, wanted: str | None) -> tuple[Engine, str]:
    """The first engine that runs a command in its base image."""
    tried = []
    for engine in engines(folder, wanted):
        try:
            base = image.base(engine, folder)
            engine("run", "--rm", base, "true")
        except SmokeError as error:
            tried.append(f"{engine.name}: {error}")
        else:
            return engine, base
    raise no_engine(wanted, tried)


if __name__ == "__main__":
    sys.exit(main())
