import json

import pytest
from pydantic import ValidationError

from risk_sac.metrics import results_digest
from risk_sac.records import EpisodeId, EpisodeRecord, stored
from risk_sac.run_folder.results import records_from_lines
from tests.builders import collision, episode_record

RECORD = episode_record(4, collision=collision(early_min_ttc_s=0.7), min_ttc_s=0.0)


def test_the_minima_of_a_collision_have_names_of_their_own_wherever_it_is_written() -> None:
    for text in (RECORD.model_dump_json(), stored(RECORD), json.dumps(RECORD.model_dump())):
        written = json.loads(text)
        assert written["min_ttc_s"] == 0.0
        assert written["collision"]["early_min_ttc_s"] == 0.7
        assert "min_ttc_s" not in written["collision"]


def test_records_read_back_as_they_were() -> None:
    (read,) = records_from_lines(stored(RECORD).encode())
    assert read == RECORD
    assert results_digest([read]) == results_digest([RECORD])


@pytest.mark.parametrize(
    "text", ["", "-", "search", "low-search-x", "low-walk-4", "a\0-search-4", "low-search-1234567890"]
)
def test_a_malformed_id_has_no_parts(text: str) -> None:
    assert EpisodeId.parse(text) is None


def test_a_run_whose_own_id_names_a_phase_keeps_it() -> None:
    assert EpisodeId.parse("low-iid-random-0-iid-12") == EpisodeId("low-iid-random-0", "iid", 12)


def test_a_collision_without_its_minimum_is_no_record() -> None:
    stored = RECORD.model_dump()
    del stored["collision"]["early_min_ttc_s"]
    with pytest.raises(ValidationError, match="early_min_ttc_s"):
        EpisodeRecord.model_validate(stored)


def test_an_episode_is_called_by_its_run_phase_and_index() -> None:
    assert RECORD.id_in("mixed-risk-sac-0") == "mixed-risk-sac-0-search-4"
