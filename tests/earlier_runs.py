"""Folders of runs that a search can start from; nothing is simulated."""

from pathlib import Path

from risk_sac.config import FamilyName, RunSpec
from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.run_folder.results import EPISODES, RunResults, write_results
from risk_sac.scenario.families import FAMILIES
from risk_sac.search.prior.shipped import shipped_library
from tests.builders import collision, episode_record

FAILURES, SAFE = 2, 3


def _episodes(family: str, *, scripts: bool = True) -> list[EpisodeRecord]:
    """Two failures of one kind, then safe episodes, at shipped library points."""
    space, points, found = FAMILIES[family].space, shipped_library(family).points, []
    for index in range(FAILURES + SAFE):
        scene, genes = space.from_unit(points[index][: space.dimension]), points[index][space.dimension :]
        failed = index < FAILURES
        found.append(
            episode_record(
                index,
                Outcome.FAILURE if failed else Outcome.SAFE,
                scene=scene.values,
                script=tuple(genes) if scripts else None,
                collision=collision() if failed else None,
            )
        )
    return found


def run_folder(folder: Path, family: FamilyName = "low", *, scripts: bool = True) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    spec = RunSpec(family=family, method="archive", seed=0)
    write_results(folder, RunResults(spec=spec, spec_digest=spec.digest, finished=True))
    lines = (
        record.model_dump_json() + "\n"
        for record in _episodes(family if family in FAMILIES else "low", scripts=scripts)
    )
    (folder / EPISODES).write_text("".join(lines))
    return folder
