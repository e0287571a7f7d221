from dataclasses import replace

import pytest
from pydantic import TypeAdapter

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.records import Outcome
from risk_sac.run_folder.durable import write_sealed
from risk_sac.run_folder.results import RESULTS, RecordedFailure, Results, read_results, write_results
from tests.builders import collision, episode_record

SPEC = RunSpec(family="low", method="random", seed=0)


@pytest.fixture
def folder(tmp_path):
    write_results(tmp_path, Results(spec=SPEC, spec_digest=SPEC.digest, finished=False, wall_s=1.25))
    return tmp_path


def test_results_survive_the_round_trip(folder):
    assert read_results(folder) == Results(spec=SPEC, spec_digest=SPEC.digest, finished=False, wall_s=1.25)
    assert read_results(folder / RESULTS) == read_results(folder)


def test_damaged_results_are_named(folder):
    content = (folder / RESULTS).read_bytes()
    for damaged in (b"", content[:-1], content.replace(b'"low"', b'"lou"')):
        (folder / RESULTS).write_bytes(damaged)
        with pytest.raises(ConfigError, match=r"results\.json is damaged"):
            read_results(folder)


def test_contacts_of_an_older_folder_are_its_failures(folder):
    known = RecordedFailure.of(SPEC.id, episode_record(4, Outcome.FAILURE, collision=collision()))
    stored = TypeAdapter(Results).dump_python(replace(read_results(folder), failures=(known,)), mode="json")
    stored["contacts"] = stored.pop("failures")
    for younger in ("requirements", "violations", "failed"):
        del stored["contacts"][0]["episode"][younger]
    write_sealed(folder / RESULTS, stored)
    (found,) = read_results(folder).failures
    assert found == known
    assert [each.requirement for each in found.episode.valid_violations] == ["no_contact"]
    assert read_results(folder).failure("4") == known
