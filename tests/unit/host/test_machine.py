import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import risk_sac.host.machine
import risk_sac.world.jit
from risk_sac.errors import ConfigError
from risk_sac.host.machine import MOST_EACH, ROLLOUTS, check_batch, cores, user_cache
from risk_sac.scenario import library


def machine(folder: Path, cgroup: str, mount: str, files: dict[str, str]) -> Path:
    """A process's folder in /proc, with the files of its control groups."""
    for name, text in files.items():
        file = folder / "cgroup_fs" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    (folder / "cgroup").write_text(cgroup)
    where = str(folder / "cgroup_fs").replace(" ", "\\040")
    (folder / "mountinfo").write_text(f"31 23 0:28 {mount.format(where)}\n")
    return folder


V2 = "/ {} rw,relatime shared:4 - cgroup2 cgroup2 rw,nsdelegate"
V1 = "/ {} rw - cgroup cgroup rw,cpu,cpuacct"


@pytest.mark.parametrize(
    ("cgroup", "mount", "files", "wanted"),
    [
        ("0::/a/b", V2, {"a/b/cpu.max": "max 100000\n", "a/cpu.max": "max 100000\n"}, 8),
        ("0::/a/b", V2, {"a/b/cpu.max": "200000 100000\n"}, 2),
        ("0::/a/b", V2, {"a/b/cpu.max": "max 100000\n", "a/cpu.max": "300000 100000\n"}, 3),
        ("0::/", V2, {"cpu.max": "150000 100000\n"}, 2),
        ("0::/a", V2, {"a/cpu.max": "10000 100000\n"}, 1),
        ("0::/docker/1", "/docker/1 {} rw - cgroup2 cgroup2 rw", {"cpu.max": "400000 100000"}, 4),
        ("4:cpu,cpuacct:/a", V1, {"a/cpu.cfs_quota_us": "250000\n", "a/cpu.cfs_period_us": "100000\n"}, 3),
        ("4:cpu,cpuacct:/a", V1, {"a/cpu.cfs_quota_us": "-1", "a/cpu.cfs_period_us": "100000"}, 8),
        ("4:memory:/a", V1, {"a/cpu.cfs_quota_us": "100000", "a/cpu.cfs_period_us": "100000"}, 8),
        ("0::/a", V2, {"a/cpu.max": "damaged"}, 8),
    ],
)
def test_as_many_cores_are_used_as_affinity_and_quotas_allow(tmp_path, monkeypatch, cgroup, mount, files, wanted):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)))
    folder = tmp_path / "with a blank"
    folder.mkdir()
    assert cores(machine(folder, cgroup, mount, files)) == wanted


def homeless() -> Path:
    raise RuntimeError("Could not determine home directory.")


def test_a_round_of_more_than_sixteen_episodes_a_process_is_refused(monkeypatch):
    monkeypatch.setenv(ROLLOUTS, str(2 * cores()))
    check_batch(MOST_EACH * 2 * cores())
    with pytest.raises(ConfigError, match=rf"budget\.batch.*{MOST_EACH * 2 * cores() + 1}.*{ROLLOUTS}"):
        check_batch(MOST_EACH * 2 * cores() + 1)


def test_a_user_without_a_home_has_no_cache_and_the_library_says_so(monkeypatch):
    for name in ("XDG_CACHE_HOME", library.VARIABLE):
        monkeypatch.delenv(name, raising=False)
    for home in (homeless, lambda: Path("relative")):
        monkeypatch.setattr(Path, "home", home)
        assert user_cache() is None
        with pytest.raises(ConfigError, match="RISK_SAC_PLACES: got nothing, and this user has no home folder"):
            library.library()
    monkeypatch.setattr(Path, "home", lambda: Path("/home/x"))
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert user_cache() == Path("/home/x/.cache")
    monkeypatch.setenv("XDG_CACHE_HOME", "/cache")
    assert library.library() == Path("/cache/risk-sac/places")


ASK = "from risk_sac.risk.outer import outer; print(outer(1.0))"
OUTER = """
from risk_sac.world.jit import compiled
from risk_sac.risk.inner import inner

@compiled
def outer(x):
    return inner(x)
"""
INNER = """
from risk_sac.world.jit import compiled
from risk_sac.risk.constants import FACTOR

@compiled
def inner(x):
    return FACTOR * x + {}
"""


@pytest.mark.parametrize("read_only", [False, True])
def test_a_change_in_a_called_function_or_a_constant_is_not_hidden_by_the_cache(tmp_path, read_only):
    package = tmp_path / "risk_sac"
    (package / "risk").mkdir(parents=True)
    for module in (risk_sac.world.jit, risk_sac.host.machine):
        folder = package / Path(module.__file__).parent.name
        folder.mkdir()
        shutil.copy(module.__file__, folder)
    if read_only:  # to root, too
        (package / "__pycache__").touch()
    for module in ("__init__.py", "risk/__init__.py", "world/__init__.py", "host/__init__.py"):
        (package / module).touch()
    (package / "risk" / "outer.py").write_text(OUTER)
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1", "XDG_CACHE_HOME": str(tmp_path / "c")}
    answers = []
    for factor, added in ((1.0, 1.0), (1.0, 1.0), (1.0, 2.0), (5.0, 2.0)):
        (package / "risk" / "inner.py").write_text(INNER.format(added))
        (package / "risk" / "constants.py").write_text(f"FACTOR = {factor}")
        found = subprocess.run(
            [sys.executable, "-c", ASK], env=environment, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert found.returncode == 0, found.stderr
        answers.append(float(found.stdout))
    assert answers == [2.0, 2.0, 3.0, 7.0]
    assert list((tmp_path / "c" if read_only else package / "__pycache__").rglob("*.nbi"))


FIRST_CALL = """
import time
import numpy as np
from risk_sac.world.geometry import overlapping_pairs
from risk_sac.world.jit import cpu_s

began_s, counted_s = time.process_time(), cpu_s()
overlapping_pairs(np.ones((20, 3)))
print(time.process_time() - began_s, cpu_s() - counted_s)
"""


def test_a_budget_of_processor_time_is_not_spent_on_compilation(tmp_path):
    """With an empty cache, compilation takes most of the first call."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    answer = subprocess.run(
        [sys.executable, "-c", FIRST_CALL], env=environment, capture_output=True, text=True, check=True
    )
    spent_s, counted_s = map(float, answer.stdout.split())
    assert counted_s < spent_s / 2
