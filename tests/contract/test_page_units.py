import shutil
import subprocess

import pytest

from tests.server import ROOT

PAGE = ROOT / "service" / "web"


def test_geometry_and_time_of_the_page() -> None:
    npm = shutil.which("npm")
    if npm is None or not (PAGE / "node_modules").is_dir():
        pytest.skip("the page's unit tests need npm, and what `make page` installs")
    said = subprocess.run([npm, "test"], cwd=PAGE, capture_output=True, text=True)
    assert said.returncode == 0, said.stdout[-4000:] + said.stderr[-2000:]
