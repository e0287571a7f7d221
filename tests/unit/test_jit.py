import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import risk_sac.jit
import risk_sac.machine

ASK = "from risk_sac.risk.outer import outer; print(outer(1.0))"
OUTER = """
from risk_sac.jit import compiled
from risk_sac.risk.inner import inner

@compiled
def outer(x):
    return inner(x)
"""
INNER = """
from risk_sac.jit import compiled
from risk_sac.risk.constants import FACTOR

@compiled
def inner(x):
    return FACTOR * x + {}
"""


@pytest.mark.parametrize("read_only", [False, True])
def test_a_change_in_a_called_function_or_a_constant_is_not_hidden_by_the_cache(
    tmp_path: Path, read_only: bool
) -> None:
    package = tmp_path / "risk_sac"
    (package / "risk").mkdir(parents=True)
    for module in (risk_sac.jit, risk_sac.machine):
        shutil.copy(module.__file__, package)
    if read_only:  # to root, too
        (package / "__pycache__").touch()
    for module in ("__init__.py", "risk/__init__.py"):
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
from risk_sac.geometry import overlapping_pairs
from risk_sac.jit import cpu_s

began_s, counted_s = time.process_time(), cpu_s()
overlapping_pairs(np.ones((20, 3)))
print(time.process_time() - began_s, cpu_s() - counted_s)
"""


def test_a_budget_of_processor_time_is_not_spent_on_compilation(tmp_path: Path) -> None:
    """With an empty cache, as in a fresh clone, compilation takes most of the first call."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    answer = subprocess.run(
        [sys.executable, "-c", FIRST_CALL], env=environment, capture_output=True, text=True, check=True
    )
    spent_s, counted_s = map(float, answer.stdout.split())
    assert counted_s < spent_s / 2
