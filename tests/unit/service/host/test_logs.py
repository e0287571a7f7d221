import json
import logging
import sys

from service.host.logs import json_formatter


def record(message, exc_info=None, **extra):
    return logging.getLogger("service.runs.manager").makeRecord(
        "service.runs.manager", logging.INFO, __file__, 1, message, (), exc_info, extra=extra
    )


def test_a_json_line_has_what_a_search_needs_and_no_colours():
    line = json_formatter().format(record("process 7", campaign="c1", run="low-sac-0", color_message="\x1b[36m7"))
    fields = json.loads(line)
    assert fields.pop("time").startswith("20")
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
