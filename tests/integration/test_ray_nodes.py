"""The service on a cluster whose nodes have network addresses of their own, as `docker/smoke` tries it."""

import os
import shutil
import subprocess
import sys

import pytest

from tests.ray_cluster import ROOT, needs_ray

LONG_S = 600


@needs_ray
@pytest.mark.torture  # most of a minute, and `docker/smoke` does it, too
@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("ip") is None, reason="network namespaces are root's")
def test_a_server_that_joins_the_cluster_comes_to_the_same_and_leaves_nothing_behind():
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "docker"), os.environ.get("PYTHONPATH", "")])}
    shown = subprocess.run(
        [sys.executable, "-m", "smoke_test", "--only", "cluster"],
        env=environment, cwd=ROOT, capture_output=True, text=True, timeout=LONG_S, check=False,
    )  # fmt: skip
    assert shown.returncode == 0, shown.stdout + shown.stderr
    assert (
        "2 runs on 2 nodes of a Ray cluster in network namespaces, with the digests that they have locally"
        in shown.stdout
    )
    assert "RAY_AUTH_MODE" in shown.stdout
