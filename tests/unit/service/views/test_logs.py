import time
from pathlib import Path

import pytest

from service.errors import StorageError
from service.views.logs import MOST_BYTES, log_tail


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "worker.log"


def test_folders_of_the_server_are_left_out(log: Path) -> None:
    log.write_text(f'File "{log.parent}/a.json" of {log.parent}\n  File "/opt/venv/lib/torch/nn.py", line 3\n')
    assert log_tail(log, 9) == f'File "a.json" of {log.parent.name}\n  File "nn.py", line 3\n'


def test_of_a_long_log_only_the_end_is_read_in_whole_lines(log: Path) -> None:
    line = "/srv/secret/name " + "x" * 982
    log.write_text("\n".join([line] * 2000) + "\nlast\n")
    told = log_tail(log, 1000).splitlines()
    assert told[-1] == "last"
    assert set(told[:-1]) == {"name " + "x" * 982}
    assert MOST_BYTES - 2 * len(line) < (len(told) - 1) * (len(line) + 1) < MOST_BYTES


def test_a_line_that_is_longer_than_what_is_read_is_left_out_since_it_may_begin_within_a_path(log: Path) -> None:
    log.write_text("/srv" + "/secret" * MOST_BYTES)
    assert log_tail(log, 9) == ""


def test_hostile_bytes_are_replaced_and_lines_end_as_they_do_everywhere(log: Path) -> None:
    log.write_bytes(b"\xff\xfe <script>\r\n10 %\r20 %\rdone\n\x1b[2J\x1b]0;title\x07 \x00\xe2\x80\xae\xc2\x9b\ttab\n")
    assert log_tail(log, 9) == "�� <script>\n10 %\n20 %\ndone\n�[2J�]0;title� ���\ttab\n"


@pytest.mark.parametrize("unit", ["-/", " /a/b/c", "/a/b/c/d/e-/-", "-" * 50 + "/", "\x1b/", "é/"])
def test_no_log_takes_long(log: Path, unit: str) -> None:
    log.write_text("\n" + unit * MOST_BYTES)
    log.write_bytes(log.read_bytes()[: MOST_BYTES - 1])
    began = time.thread_time()
    log_tail(log, 1000)
    assert time.thread_time() - began < 3


def test_a_log_that_cannot_be_read_says_why_and_not_where(log: Path) -> None:
    log.mkdir()
    with pytest.raises(StorageError, match="Is a directory") as refused:
        log_tail(log, 9)
    assert str(log.parent) not in str(refused.value)
