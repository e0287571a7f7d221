"""Time series and logs of a run, and the time left."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.config import CampaignSpec
from risk_sac.records import State
from risk_sac.run_folder.series import pack_series, write_series
from service.errors import StorageError
from service.views.progress import MOST_BYTES, eta_s, log_tail, retry_after_s
from service.views.series import load_series
from tests.begun import BEGUN
from tests.contract.recorded_campaigns import series_arrays


def test_a_lost_or_damaged_series_is_a_storage_error_not_a_crash(tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(StorageError, match=r"'a\.npz' is gone"):
        load_series(path, None)
    write_series(path, pack_series(series_arrays()))
    whole = path.read_bytes()
    for size in range(0, len(whole), 97):
        path.write_bytes(whole[:size])
        with pytest.raises(StorageError, match="is damaged"):
            load_series(path, None)
    path.write_bytes(whole[:200] + bytes(byte ^ 0xFF for byte in whole[200:260]) + whole[260:])
    with pytest.raises(StorageError, match="is damaged"):
        load_series(path, None)


@pytest.mark.parametrize(
    "wrong",
    [{"time_s": np.zeros(2**25)}, {"kind": np.full(2, 99)}, {"x_m": np.zeros(3)}, {"signal": np.full(3, np.nan)}],
    ids=["too large", "unknown kind", "another shape", "no kind"],
)
def test_what_no_worker_writes_is_a_storage_error_not_a_crash(wrong, tmp_path):
    write_series(tmp_path / "a.npz", pack_series(series_arrays() | wrong))
    with pytest.raises(StorageError, match=r"'a\.npz' is damaged"):
        load_series(tmp_path / "a.npz", None)


def test_a_series_that_is_not_the_one_that_was_written_is_never_shown(tmp_path):
    path = tmp_path / "a.npz"
    sha256 = write_series(path, pack_series(series_arrays())).sha256
    assert load_series(path, sha256) == load_series(path, None)
    whole = path.read_bytes()
    for bit in range(0, 8 * len(whole), 8 * len(whole) // 60):
        path.write_bytes(whole[: bit // 8] + bytes([whole[bit // 8] ^ 1 << bit % 8]) + whole[bit // 8 + 1 :])
        with pytest.raises(StorageError, match=f"'a.npz' is damaged: its SHA-256 is [0-9a-f]{{64}}, wanted {sha256}"):
            load_series(path, sha256)
    write_series(path, pack_series(series_arrays() | {"soft_min": np.ones(3)}))  # undamaged, and another
    with pytest.raises(StorageError, match="damaged"):
        load_series(path, sha256)


@pytest.fixture
def log(tmp_path):
    return tmp_path / "worker.log"


def test_folders_of_the_server_are_left_out(log):
    log.write_text(f'File "{log.parent}/a.json" of {log.parent}\n  File "/opt/venv/lib/torch/nn.py", line 3\n')
    assert log_tail(log, 9) == f'File "a.json" of {log.parent.name}\n  File "nn.py", line 3\n'


def test_of_a_long_log_only_the_end_is_read_in_whole_lines(log):
    line = "/srv/secret/name " + "x" * 982
    log.write_text("\n".join([line] * 2000) + "\nlast\n")
    told = log_tail(log, 1000).splitlines()
    assert told[-1] == "last"
    assert set(told[:-1]) == {"name " + "x" * 982}
    assert MOST_BYTES - 2 * len(line) < (len(told) - 1) * (len(line) + 1) < MOST_BYTES


def test_a_line_that_is_longer_than_what_is_read_is_left_out_since_it_may_begin_within_a_path(log):
    log.write_text("/srv" + "/secret" * MOST_BYTES)
    assert log_tail(log, 9) == ""


def test_hostile_bytes_are_replaced_and_lines_end_as_they_do_everywhere(log):
    log.write_bytes(b"\xff\xfe <script>\r\n10 %\r20 %\rdone\n\x1b[2J\x1b]0;title\x07 \x00\xe2\x80\xae\xc2\x9b\ttab\n")
    assert log_tail(log, 9) == "�� <script>\n10 %\n20 %\ndone\n�[2J�]0;title� ���\ttab\n"


@pytest.mark.parametrize("unit", ["-/", " /a/b/c", "/a/b/c/d/e-/-", "-" * 50 + "/", "\x1b/", "é/"])
def test_no_log_takes_long(log, unit):
    log.write_text("\n" + unit * MOST_BYTES)
    log.write_bytes(log.read_bytes()[: MOST_BYTES - 1])
    began = time.thread_time()
    log_tail(log, 1000)
    assert time.thread_time() - began < 3


def test_a_log_that_cannot_be_read_says_why_and_not_where(log):
    log.mkdir()
    with pytest.raises(StorageError, match="Is a directory") as refused:
        log_tail(log, 9)
    assert str(log.parent) not in str(refused.value)


SPEC = CampaignSpec(families=("low",), methods=("random",))
RUN = BEGUN.model_copy(update={"method": "random"})


def changed(run, **fields):
    return run.model_copy(update=fields)


def after_start(done, worked_s, start_s=5.0):
    """Run of `random` that has played `done` episodes after its first."""
    pace_s = worked_s / done if done else None
    return changed(RUN, episodes_done=done + 1, pace_s=pace_s, busy_s=start_s + worked_s)


@pytest.mark.parametrize(
    ("done", "workers", "wanted"),
    [
        ([(19, 38.0)], 2, 160.0),  # 80 left at 2 s
        ([(19, 38.0), (59, 59.0)], 2, 160.0),  # the slower of two at once
        ([(19, 38.0), (59, 59.0)], 1, 200.0),  # one after the other
    ],
)
def test_eta_is_work_left_at_each_runs_own_pace(done, workers, wanted):
    assert eta_s([after_start(*each) for each in done], SPEC, workers) == pytest.approx(wanted)


@given(st.lists(st.tuples(st.integers(1, 99), st.floats(0.1, 100)), min_size=1, max_size=6), st.integers(1, 8))
def test_more_workers_never_take_longer(done, workers):
    runs = [after_start(*each) for each in done]
    assert 0 <= eta_s(runs, SPEC, workers + 1) <= eta_s(runs, SPEC, workers)


@pytest.mark.parametrize(
    ("done", "busy_s", "wanted"),
    [(0, 0.0, 1), (49, 1.0, 1), (49, 98.0, 5), (49, 100.0, 6), (49, 9_800.0, 30)],  # a little longer than it took
)
def test_a_look_pays_after_a_twentieth_of_the_time_left(ledger, done, busy_s, wanted):
    campaign = ledger.create(SPEC)
    runs = (after_start(done, busy_s),)
    assert retry_after_s(changed(campaign, state=State.RUNNING, runs=runs), workers=1) == wanted
