import json

import pytest

from risk_sac.records import EpisodeId
from risk_sac.run_folder.results import records_to_json
from tests.builders import collision, episode_record

RECORD = episode_record(4, collision=collision(min_ttc_s=0.7), min_ttc_s=0.0)


def test_the_minima_of_a_collision_have_names_of_their_own_wherever_it_is_written() -> None:
    for text in (RECORD.model_dump_json(), records_to_json([RECORD])[1:-1], json.dumps(RECORD.model_dump())):
        written = json.loads(text)
        assert written["min_ttc_s"] == 0.0
        assert written["collision"]["early_min_ttc_s"] == 0.7
        assert "min_ttc_s" not in written["collision"]


@pytest.mark.parametrize(
    "text", ["", "-", "search", "low-search-x", "low-walk-4", "a\0-search-4", "low-search-1234567890"]
)
def test_a_malformed_id_has_no_parts(text: str) -> None:
    assert EpisodeId.parse(text) is None


def test_a_run_whose_own_id_names_a_phase_keeps_it() -> None:
    assert EpisodeId.parse("low-iid-random-0-iid-12") == EpisodeId("low-iid-random-0", "iid", 12)
