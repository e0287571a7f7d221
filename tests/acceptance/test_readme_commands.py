"""README.md's commands, in a fresh clone, print what it shows."""

import sys
from pathlib import Path

import pytest

from tests.acceptance.readme import check, cloned, save, steps
from tests.server import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_readme_has_the_two_commands_and_those_of_a_run():
    commands = [step.command for step in steps(README)]
    assert commands[:2] == ["make install", "source .venv/bin/activate"]
    assert commands[-2:] == ["make demo", "make test"]


@pytest.mark.timeout(3600)
@pytest.mark.skipif(not (Path(sys.prefix) / "bin" / "activate").exists(), reason="needs the .venv of `make install`")
def test_commands_of_a_run_print_what_readme_shows(tmp_path, monkeypatch):
    """Leaves out `make`, which `python -m tests.acceptance.readme` runs in half an hour."""
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # helpers too run what is installed, whose functions are compiled
    clone = cloned(tmp_path)
    (clone / ".venv").symlink_to(sys.prefix)
    save(README, clone)
    check(clone, [step for step in steps(README) if not step.command.startswith("make")])
