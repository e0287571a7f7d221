"""Overlapping bodies in recorded series, for tests that have a failure."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from risk_sac.errors import RiskSacError
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import read_results
from risk_sac.verdicts.evidence import Evidence, Ground
from risk_sac.verdicts.validity import Overlap, overlaps_before_contact


def overlaps_in(series: Mapping[str, NDArray[Any]]) -> list[Overlap]:
    """Returns an episode's overlaps, except of the bodies that finally touch."""
    return overlaps_before_contact(Evidence.from_series(series, Ground(), float(series["released_s"])))


def overlaps_before_valid_contacts(results: Path) -> dict[Path, list[Overlap]]:
    """Returns series → overlaps, if any; ignores files that tests have damaged."""
    try:
        contacts = [each for each in read_results(results).failures if each.episode.collision]
    except RiskSacError:
        return {}
    found = {}
    for contact in contacts:
        series = results.parent / contact.series
        try:
            overlaps = overlaps_in(read_series(series)) if contact.episode.collision.valid else []  # type: ignore[union-attr]
        except (RiskSacError, FileNotFoundError):
            continue
        if overlaps:
            found[series] = overlaps
    return found
