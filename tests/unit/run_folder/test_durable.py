"""Sealed files, damaged results, and records as they are stored and answered."""

import json
import math
import os
import stat
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError, DamagedError
from risk_sac.records import Episode, EpisodeId, EpisodeRecord, stored, wire
from risk_sac.run_folder.durable import replace_file, seal, unseal
from risk_sac.run_folder.results import RESULTS, RecordedFailure, RunResults, read_results, write_results
from tests.builders import collision, episode_record, judgement


class Note(BaseModel):
    name: str = "ε"
    values: tuple[float | None, ...] = (1.5, None)
    sha256_of: dict[str, str] = {"sha256": "of something else"}


def test_sealed_text_is_json_with_one_more_field():
    assert json.loads(seal(Note())).keys() - Note.model_fields.keys() == {"sha256"}
    assert unseal(seal(Note()), Note) == Note()


@given(st.dictionaries(st.text(), st.integers() | st.text(), min_size=1))
def test_what_was_sealed_comes_back(value):
    assert unseal(seal(value), dict) == value


@pytest.mark.parametrize("count", [0, 1, 3])
def test_results_are_written_one_failure_at_a_time_as_if_at_once(tmp_path, count):
    records = [episode_record(index=index, reason="a\nb", min_ttc_s=math.nan) for index in range(count)]
    failures = tuple(RecordedFailure.of("run", record) for record in records)
    results = RunResults(
        spec=RunSpec(family="low", method="random", seed=0), spec_digest="", adjustments=(), finished=True
    )
    write_results(tmp_path, results, iter(failures))
    assert (tmp_path / RESULTS).read_bytes() == seal(replace(results, failures=failures))
    assert [each.id for each in read_results(tmp_path).failures] == [each.id for each in failures]


def test_every_flipped_bit_and_every_lost_end_is_noticed():
    sealed = seal(Note())
    damaged = [sealed[:length] for length in range(len(sealed))]
    damaged += [
        sealed[: bit // 8] + bytes([sealed[bit // 8] ^ 1 << bit % 8]) + sealed[bit // 8 + 1 :]
        for bit in range(8 * len(sealed))
    ]
    for content in damaged:
        with pytest.raises(DamagedError):
            unseal(content, Note)


def test_a_file_gets_its_mode_whatever_a_killed_writer_left(tmp_path):
    file = tmp_path / "secret"
    (tmp_path / ".secret.tmp").write_text("left over")
    before = os.umask(0)
    try:
        replace_file(file, b"new", mode=0o600)
    finally:
        os.umask(before)
    assert (file.read_bytes(), stat.S_IMODE(file.stat().st_mode)) == (b"new", 0o600)
    assert [each.name for each in tmp_path.iterdir()] == ["secret"]


SPEC = RunSpec(family="low", method="random", seed=0)


@pytest.fixture
def folder(tmp_path):
    write_results(tmp_path, RunResults(spec=SPEC, spec_digest=SPEC.digest, finished=False, wall_s=1.25))
    return tmp_path


def test_damaged_results_are_named(folder):
    content = (folder / RESULTS).read_bytes()
    for damaged in (b"", content[:-1], content.replace(b'"low"', b'"lou"')):
        (folder / RESULTS).write_bytes(damaged)
        with pytest.raises(ConfigError, match=r"results\.json is damaged"):
            read_results(folder)


RECORD = episode_record(4, collision=collision(early_min_ttc_s=0.7), min_ttc_s=0.0)


def test_the_minima_of_a_collision_have_names_of_their_own_wherever_it_is_written():
    for text in (RECORD.model_dump_json(), stored(RECORD), json.dumps(RECORD.model_dump())):
        written = json.loads(text)
        assert written["min_ttc_s"] == 0.0
        assert written["collision"]["early_min_ttc_s"] == 0.7
        assert "min_ttc_s" not in written["collision"]


@pytest.mark.parametrize(
    "text", ["", "-", "search", "low-search-x", "low-walk-4", "a\0-search-4", "low-search-1234567890"]
)
def test_a_malformed_id_has_no_parts(text):
    assert EpisodeId.parse(text) is None


def test_a_run_whose_own_id_names_a_phase_keeps_it():
    assert EpisodeId.parse("low-iid-random-0-iid-12") == EpisodeId("low-iid-random-0", "iid", 12)


# Loads `risk_sac.records.violation` with one field more, and passes a contact that has it through the service.


def test_a_number_that_is_not_finite_is_a_word_where_it_is_stored_and_null_where_it_is_answered():
    hit = collision(early_min_ttc_s=math.inf, ego_speed_mps=math.nan, judgement=judgement(conflict_s=-math.inf))
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
    assert (read.min_ttc_s, read.collision.early_min_ttc_s) == (math.inf, math.inf)
    assert math.isnan(read.collision.ego_speed_mps)
    assert wire(read) == wire(episode)
