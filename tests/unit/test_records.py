"""A field of a record is declared once: store, answer and client have it without another edit."""

import json
import math
import subprocess
import sys

from risk_sac.records import Episode, EpisodeRecord, stored, wire
from tests.builders import collision, episode_record, judgement

# Loads `risk_sac.records.violation` with one field more, and passes a contact that has it through the service.
NEW_FIELD = r"""
import importlib.util, sys
from importlib.machinery import PathFinder, SourceFileLoader

class WithNewField(SourceFileLoader):
    def source_to_code(self, data, path, **options):
        anchor = b"class Collision(Violated):\n"
        assert anchor in data
        field = b"    bonnet_temperature_c: Real = 20.0\n"
        head, tail = data.split(anchor)
        docstring, rest = tail.split(b"\n\n", 1)
        return super().source_to_code(head + anchor + docstring + b"\n\n" + field + rest, path, **options)

    def get_code(self, fullname):
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)

class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name != "risk_sac.records.violation":
            return None
        found = PathFinder.find_spec(name, path)
        return importlib.util.spec_from_loader(name, WithNewField(name, found.origin))

sys.meta_path.insert(0, Finder)

from risk_sac.client import Failure
from risk_sac.config import CampaignSpec
from risk_sac.records import Outcome, wire
from service.app import create_app
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.writing import Ledger
from service.views.series import failure_body
from risk_sac.execution.messages import EpisodeDone, decode, encode
from tests.builders import collision, episode_record, run_metrics

settings = ServiceSettings(data_dir=sys.argv[1])
store = Store("sqlite:///" + sys.argv[1] + "/test.db")
ledger = Ledger(store)
campaign = ledger.create(CampaignSpec(families=("low",), methods=("random",)))
ledger.start_run(campaign.runs[0].number)
record = episode_record(0, Outcome.FAILURE, collision=collision(bonnet_temperature_c=61.5))
said = EpisodeDone(record=record, metrics=run_metrics(1), series=None, wall_s=1.0)
ledger.add_episodes([(campaign.runs[0].number, decode(encode(said)))])
answer = wire(failure_body(campaign.id, store.failure(campaign.id, "low-random-0-search-0"), None, settings))
print(Failure.model_validate_json(answer).collision.bonnet_temperature_c)
print("bonnet_temperature_c" in create_app(settings).openapi()["components"]["schemas"]["Collision"]["properties"])
store.close()
"""


def test_a_new_field_of_a_failure_is_stored_answered_described_and_read_by_the_client(tmp_path):
    done = subprocess.run([sys.executable, "-c", NEW_FIELD, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["61.5", "True"], done.stderr


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
