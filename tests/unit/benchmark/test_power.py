import pytest

from risk_sac.benchmark.power import MEASURED, DefectPower, in_words, power, runs_of
from risk_sac.egos.defects.catalogue import DEFECTS
from risk_sac.errors import ConfigError

TEXT = """defects,family,method,seed,budget_steps,steps,detected,signature
latency,low,archive,0,20000,300,300,"a, b"
latency,low,archive,1,20000,20000,,
speeds,mixed,archive,0,20000,9000,9000,a
no-memory,dense,archive,0,20000,100,100,a
latency,low,random,0,5000,5000,,
"""


def test_the_power_of_a_budget_is_what_was_detected_within_it() -> None:
    runs = runs_of(TEXT)
    found = power(runs, ["low", "mixed"], "archive", 9000)
    assert found == [DefectPower("latency", "low", 1, 2), DefectPower("speeds", "mixed", 1, 1)]
    assert in_words(found) == "Of 2 known defects this budget detects 1.5 on average; each at least once."
    found = power(runs, ["low", "mixed"], "archive", 8999)
    assert in_words(found) == "Of 2 known defects this budget detects 0.5 on average; never: speeds."


def test_what_was_not_measured_is_refused_in_a_line() -> None:
    runs = runs_of(TEXT)
    with pytest.raises(ConfigError, match=r"steps: got 20001 steps of 'archive' in low; wanted at most 20000, which"):
        power(runs, ["low"], "archive", 20001)
    with pytest.raises(ConfigError, match=r"method: got 100 steps of 'sac' in low; wanted one of .* archive, random"):
        power(runs, ["low"], "sac", 100)


def test_what_is_shipped_is_of_the_catalogue() -> None:
    runs = runs_of(MEASURED.read_text(encoding="utf-8"))
    assert {each.defect for each in runs} <= DEFECTS.keys()
    assert power(runs, ["low", "mixed", "dense"], "archive", 20_000)
