"""A field of a record is declared once: store, answer and client have it without another edit."""

import json
import math

from risk_sac.records import Episode, EpisodeRecord, stored, wire
from tests.builders import collision, episode_record, judgement

# Loads `risk_sac.records.violation` with one field more, and passes a contact that has it through the service.


def test_a_number_that_is_not_finite_is_a_word_where_it_is_stored_and_null_where_it_is_answered():
    hit = collision(min_ttc_s=math.inf, ego_speed_mps=math.nan, judgement=judgement(conflict_s=-math.inf))
    record = episode_record(3, collision=hit, min_ttc_s=math.inf)
    kept = json.loads(stored(record))
    assert (kept["min_ttc_s"], kept["collision"]["early_min_ttc_s"]) == ("Infinity", "Infinity")
    assert kept["collision"]["judgement"]["conflict_s"] == "-Infinity"
    assert repr(EpisodeRecord.model_validate_json(stored(record))) == repr(record)
    episode = Episode(**dict(record), id="r-search-3", run_id="r", wall_s=0.5)
    told = json.loads(wire(episode))
    assert (told["min_ttc_s"], told["collision"]["early_min_ttc_s"]) == (None, None)
    assert told["collision"]["ego_speed_mps"] is told["collision"]["judgement"]["conflict_s"] is None
    read = Episode.model_validate_json(wire(episode))
    assert (read.min_ttc_s, read.collision.min_ttc_s) == (math.inf, math.inf)
    assert math.isnan(read.collision.ego_speed_mps)
    assert wire(read) == wire(episode)
