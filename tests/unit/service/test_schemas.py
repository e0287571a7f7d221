import dataclasses
import json
import typing

import numpy as np
import pytest
from pydantic import TypeAdapter

from risk_sac.metrics import Funnel
from risk_sac.run_folder.series import PER_ACTOR, PER_OTHER, write_series
from risk_sac.types import Collision, EpisodeRecord, Judgement, Outcome, ReferenceOutcome, RunMetrics
from service import schemas
from service.api.views import episode_body
from service.errors import StorageError
from service.records import Episode
from service.series import load_series

each_record = pytest.mark.parametrize(
    ("record", "body", "added"),
    [
        (RunMetrics, schemas.Metrics, set()),
        (Collision, schemas.Collision, set()),
        (Judgement, schemas.Judgement, set()),
        (ReferenceOutcome, schemas.ReferenceOutcome, set()),
        (Funnel, schemas.Funnel, set()),
        (EpisodeRecord, schemas.Episode, {"id", "run_id", "wall_s", "funnel"}),
    ],
)


@each_record
def test_what_may_be_none_in_a_record_may_be_null_in_its_body(record, body, added):
    for name, hint in typing.get_type_hints(record).items():
        if type(None) in typing.get_args(hint):
            assert TypeAdapter(body.model_fields[name].annotation).validate_python(None) is None, name


@each_record
def test_a_body_has_every_field_of_its_record(record, body, added):
    assert {field.name for field in dataclasses.fields(record)} | added == set(body.model_fields)


def shown(record, funnel=None):
    return episode_body(
        Episode(number=1, run_id="r", record=record, series=None, series_sha256=None, wall_s=0.5, funnel=funnel)
    )


def test_a_contact_says_who_would_have_prevented_it(episode):
    body = shown(episode(3, Outcome.FAILURE).record, Funnel(contacts=4, valid=3, distinct=2, preventable=1))
    found = json.loads(body.model_dump_json())
    judged = found["collision"]["judgement"]
    assert (judged["grade"], judged["conflict_type"], judged["conflict_s"]) == ("careful", "cut_in", 2.5)
    assert judged["broke"] == ["red_light", "speeding"]
    assert judged["drivers"]["bound"] == {"avoids": True, "impact_speed_mps": 0.0}
    assert found["funnel"] == {"contacts": 4, "valid": 3, "distinct": 2, "preventable": 1}


def test_a_contact_from_before_there_were_judgements_has_none(episode):
    record = episode(3, Outcome.FAILURE).record
    body = shown(dataclasses.replace(record, collision=dataclasses.replace(record.collision, judgement=None)))
    assert (body.collision.judgement, body.funnel) == (None, None)


def test_numbers_that_are_not_finite_are_null(episode):
    body = shown(episode(3, Outcome.FAILURE).record)
    assert body.min_ttc_s is None
    assert body.collision.min_ttc_s is None
    assert body.collision.min_robustness is None
    assert body.collision.ego_speed_mps == 9.0


def arrays(steps=3, actors=2):
    rows = np.arange(steps * actors, dtype=float).reshape(steps, actors)
    rows[1, 1] = np.nan
    series = dict.fromkeys((*PER_ACTOR, *PER_OTHER), rows)
    return series | {
        "time_s": np.arange(steps) / 10,
        "ids": np.array(["ego", "lead"]),
        "kind": np.array([0, 1], dtype=np.int8),
        "role": np.array([0, 1], dtype=np.int8),
        "length_m": np.array([4.6, 0.5]),
        "width_m": np.array([1.8, 0.5]),
        "visible": np.array([[np.nan, 1.0], [np.nan, np.nan], [np.nan, 0.0]]),
        "requirements": np.array(["safe_ttc"]),
        "robustness": np.array([[1.0], [np.inf], [-1.0]]),
        "soft_min": np.zeros(steps),
        "actions": np.zeros((steps, 4), dtype=np.float32),
        "signal": np.array([0, 3, 1], dtype=np.int8),
    }


def test_a_series_is_plain_and_null_where_an_actor_is_absent(tmp_path):
    write_series(tmp_path / "a.npz", arrays())
    series = load_series(tmp_path / "a.npz", None)
    assert series.x_m == [[0.0, 1.0], [2.0, None], [4.0, 5.0]]
    assert series.visible == [[None, True], [None, None], [None, False]]
    assert series.kind == ["vehicle", "pedestrian"]
    assert series.role == ["ego", "adversary"]
    assert series.signal == ["none", "red", "green"]
    assert series.robustness == [[1.0], [None], [-1.0]]
    assert len(series.actions[0]) == 4


def test_a_series_from_before_the_release_was_recorded_lacks_it(tmp_path):
    new = ("lane_offset_m", "link")
    write_series(tmp_path / "a.npz", {name: values for name, values in arrays().items() if name not in new})
    series = load_series(tmp_path / "a.npz", None)
    assert (series.released_s, series.lane_offset_m, series.link) == (None, None, None)


@pytest.mark.parametrize(
    "link",
    [
        np.array([[ord("G"), 0], [ord("g"), 0], [ord("r"), 0]], dtype=np.uint8),
        np.array([[ord("G"), np.nan], [ord("g"), np.nan], [ord("r"), 0]]),
        np.array([["G", ""], ["g", ""], ["r", ""]]),
    ],
)
def test_a_series_says_when_the_release_was_and_which_signal_lies_ahead(tmp_path, link):
    rows = np.array([[0.1, np.nan], [0.2, 0.0], [0.3, 0.0]])
    written = arrays() | {"released_s": np.array(1.5), "lane_offset_m": rows, "link": link}
    write_series(tmp_path / "a.npz", written)
    series = load_series(tmp_path / "a.npz", None)
    assert series.released_s == 1.5
    assert series.lane_offset_m == [[0.1, None], [0.2, 0.0], [0.3, 0.0]]
    assert series.link == [["G", None], ["g", None], ["r", None]]


def test_a_lost_or_damaged_series_is_a_storage_error_not_a_crash(tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(StorageError, match=r"'a\.npz' is gone"):
        load_series(path, None)
    write_series(path, arrays())
    whole = path.read_bytes()
    for size in range(0, len(whole), 97):
        path.write_bytes(whole[:size])
        with pytest.raises(StorageError, match="is damaged"):
            load_series(path, None)
    path.write_bytes(whole[:200] + bytes(byte ^ 0xFF for byte in whole[200:260]) + whole[260:])
    with pytest.raises(StorageError, match="is damaged"):
        load_series(path, None)


def test_a_series_that_is_not_the_one_that_was_written_is_never_shown(tmp_path):
    path = tmp_path / "a.npz"
    sha256 = write_series(path, arrays()).sha256
    assert load_series(path, sha256) == load_series(path, None)
    whole = path.read_bytes()
    for bit in range(0, 8 * len(whole), 8 * len(whole) // 60):
        path.write_bytes(whole[: bit // 8] + bytes([whole[bit // 8] ^ 1 << bit % 8]) + whole[bit // 8 + 1 :])
        with pytest.raises(StorageError, match=f"'a.npz' is damaged: its SHA-256 is [0-9a-f]{{64}}, wanted {sha256}"):
            load_series(path, sha256)
    write_series(path, arrays() | {"soft_min": np.ones(3)})  # undamaged, and another
    with pytest.raises(StorageError, match="damaged"):
        load_series(path, sha256)
