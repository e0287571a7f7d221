import json
import logging
import sys
import time
from datetime import datetime, timedelta

import pytest

from risk_sac.host.terminal import LogFormatter
from service.host.logs import TextFormatter, json_formatter


def record(message, exc_info=None, **extra):
    return logging.getLogger("service.runs.manager").makeRecord(
        "service.runs.manager", logging.INFO, __file__, 1, message, (), exc_info, extra=extra
    )


@pytest.mark.parametrize(
    ("extra", "end"),
    [
        ({}, "service.runs.manager: process 7"),
        ({"campaign": "c1"}, "process 7 [campaign c1]"),
        ({"campaign": "c1", "run": "low-sac-0"}, "process 7 [campaign c1, run low-sac-0]"),
        ({"campaign": None, "ms": 3}, "process 7"),
    ],
)
def test_a_line_ends_with_what_it_is_about(extra, end):
    assert TextFormatter().format(record("process 7", **extra)).endswith(end)


@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo", "America/St_Johns"])
def test_a_line_begins_with_its_time_in_utc_wherever_the_machine_is(monkeypatch, zone):
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    told = record("process 7")
    for line in (TextFormatter().format(told), LogFormatter().format(told)):
        shown = datetime.fromisoformat(line.partition(" ")[0])
        assert shown.utcoffset() == timedelta(0)
        assert abs(shown.timestamp() - told.created) < 0.002
    monkeypatch.undo()
    time.tzset()


def test_a_json_line_has_what_a_search_needs_and_no_colours():
    line = json_formatter().format(record("process 7", campaign="c1", run="low-sac-0", color_message="\x1b[36m7"))
    fields = json.loads(line)
    assert datetime.fromisoformat(fields.pop("time")).utcoffset() == timedelta(0)
    assert fields == {
        "level": "INFO",
        "logger": "service.runs.manager",
        "message": "process 7",
        "campaign": "c1",
        "run": "low-sac-0",
    }


def test_a_traceback_stays_on_its_json_line():
    try:
        raise ValueError("wrong\nline")
    except ValueError:
        line = json_formatter().format(record("a bug", exc_info=sys.exc_info()))
    assert "\n" not in line
    assert "ValueError: wrong\nline" in json.loads(line)["exc_info"]
