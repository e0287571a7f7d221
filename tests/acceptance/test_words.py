"""Captions of the failures of a campaign, read back and compared with their tables and time series."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from risk_sac.cli import main
from risk_sac.config import FamilyName
from risk_sac.failures.recording import Recording
from risk_sac.failures.show import caption
from risk_sac.records import Collision, Judgement, Violation
from risk_sac.run_folder.results import read_results
from risk_sac.run_folder.series import read_series

EPISODES, SEED = 40, 5
NAMES = {
    "R157's driver": "r157",
    "the fuzzy safety model": "fsm",
    "the RSS driver": "rss",
    "the defensive driver": "defensive",
    "full braking at once": "full_braking",
    "R157's time-to-collision rule": "r157_ttc",
}
BRAKES_MPS2, STANDS_MPS = 1.5, 0.5


class Told(NamedTuple):
    """A failure with what is said of it."""

    violation: Collision | Violation
    series: Mapping[str, Any]
    title: str


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> list[Told]:
    """All recorded failures of a small campaign per family, refused ones included."""
    return [each for family in ("low", "mixed", "dense") for each in _told(family, tmp_path_factory.mktemp(family))]


def _told(family: FamilyName, folder: Path) -> list[Told]:
    asked = {"family": family, "method": "archive", "episodes": EPISODES, "seed": SEED, "out": folder / "run"}
    assert main(["run", *(str(word) for name, value in asked.items() for word in (f"--{name}", value))]) == 0
    found = []
    for failure in read_results(folder / "run").failures:
        series = read_series(folder / "run" / failure.series)
        recording = Recording(failure, series)
        title = " ".join(caption(family, recording).split())
        found.append(Told(recording.violation, series, title))
    return found


@pytest.fixture(scope="module")
def contacts(told: list[Told]) -> list[tuple[Told, Collision, Judgement]]:
    """The judged contacts among them; of every family at least one."""
    found = [(each, each.violation) for each in told if isinstance(each.violation, Collision)]
    assert len(found) >= 3
    return [(each, hit, hit.judgement) for each, hit in found if hit.judgement is not None]


def test_exactly_the_drivers_of_the_table_that_prevent_it_are_named(told: list[Told]) -> None:
    graded = [each for each in told if each.violation.graded is not None]
    assert graded
    for each in graded:
        said = re.search(
            r"grade (\w+): (only )?(.*?) would have prevented it(; by (.*?) it is preventable)?", each.title
        )
        assert said
        names = {NAMES[name] for name in re.split(", | and ", said[3]) if name != "none of the reference drivers"}
        assert names | ({NAMES[said[5]]} if said[4] else set()) == {
            name for name, prevents in each.violation.prevention.items() if prevents
        }
        assert bool(said[2]) == (names == {"full_braking"}) == (said[1] == "full_braking")
        assert (not names) == (said[1] == "unavoidable")


def test_the_fault_and_what_the_ego_did_agree_with_the_series(
    contacts: list[tuple[Told, Collision, Judgement]],
) -> None:
    assert any(judged.fault for _, _, judged in contacts)
    for each, hit, judged in contacts:
        told = re.search(r"fault: (\w+) · the ego (.*?) (?:broken by|$)", each.title)
        assert (told and told[1]) == (judged.fault and str(judged.fault))
        if not told:
            assert not hit.valid
            continue
        speed, accel = (each.series[name][:, 0] for name in ("speed_mps", "accel_mps2"))
        conflict = min(round((hit.time_s - judged.conflict_s) * 10) + 1, len(accel))
        braked = np.flatnonzero(accel[-conflict:] <= -BRAKES_MPS2) / 10
        after = re.search(
            r"(?:braked ([\d.]+) s after|was braking when) the conflict began, by ([\d.]+) of ([\d.]+) m", told[2]
        )
        assert bool(after) == bool(len(braked)) != ("did not brake" in told[2])
        if after:
            assert float(after[1] or 0.0) == pytest.approx(braked[0], abs=0.151)
            assert float(after[2]) == pytest.approx(-accel[-conflict:].min(), abs=0.051)
            assert float(after[2]) <= float(after[3]) + 0.1
        rises = np.maximum.accumulate(speed[::-1])[::-1] - speed
        if "drove on" in told[2]:
            assert judged.ego_part is not None
            assert judged.ego_part.seen_s > 0.0
            assert rises[-41:].max() >= STANDS_MPS
            assert min(speed[-41:].min(), accel[-41:].min() + 2.0) < STANDS_MPS
        gained = re.search(r"gained ([\d.]+) m/s", told[2])
        assert not gained or rises.max() >= float(gained[1]) - 0.051
        fast = re.search(r"drove at ([\d.]+) m/s where its sight allowed ([\d.]+) m/s", told[2])
        assert not fast or float(fast[1]) > float(fast[2])
