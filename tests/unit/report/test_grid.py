"""The standard's verdict on scenes: its value, and how it is written."""

import csv
import io
import json

import pytest
from junitparser import JUnitXml

from risk_sac import cli
from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.records import Grade, Outcome, stored
from risk_sac.report.grid import StandardVerdict, grid_csv, named_values, played_grids, verdict_on
from risk_sac.run_folder.results import EPISODES, RunResults, write_results
from risk_sac.scenario.families import FAMILIES
from tests.builders import collision, episode_record, judgement, violation

FAMILY = "motorway_cut_in"
SPEC = RunSpec(family=FAMILY, method="story-sweep", seed=0)
CONTACT = collision(judgement=judgement(Grade.PREVENTABLE, kind="cut-in"))
SCENE = {
    name: 0.0 if parameter.alternatives else parameter.range[0]
    for name, parameter in FAMILIES[FAMILY].parameters.items()
}


def record(outcome=Outcome.SAFE, index=0, r157=True, fsm=True, **changes):
    avoided = None if outcome is Outcome.REJECTED else {"r157": r157, "fsm": fsm}
    contact = CONTACT if outcome is Outcome.FAILURE else None
    return episode_record(index, outcome, **({"avoided_by": avoided, "collision": contact, "scene": SCENE} | changes))


@pytest.mark.parametrize(
    ("played", "standard", "verdict"),
    [
        (record(), "r157", StandardVerdict.PASS),
        (record(r157=False, fsm=False), "r157", StandardVerdict.PASS),
        (record(Outcome.FAILURE), "r157", StandardVerdict.FAIL),
        (record(Outcome.FAILURE, r157=False), "r157", StandardVerdict.OUT_OF_SCOPE),
        (record(Outcome.FAILURE, r157=False), "fsm", StandardVerdict.FAIL),
        (record(Outcome.FAILURE, r157=False), "either", StandardVerdict.FAIL),
        (record(Outcome.FAILURE, r157=False, fsm=False), "either", StandardVerdict.OUT_OF_SCOPE),
        (record(Outcome.FAILURE, r157=False, collision=None, violations=(violation(),)), "r157", StandardVerdict.FAIL),
        (record(Outcome.REJECTED, reason="constraint"), "r157", StandardVerdict.REFUSED),
        (record(Outcome.DEGENERATE), "r157", StandardVerdict.UNJUDGED),
        (record(Outcome.INVALID), "r157", StandardVerdict.UNJUDGED),
    ],
)
def test_the_verdict_follows_from_the_ego_and_the_competent_driver(played, standard, verdict):
    assert verdict_on(played, standard) is verdict


def test_values_are_words_and_columns_of_rows():
    named = named_values(SCENE | {"side": 0.75, "cutter_body": 0.5}, FAMILIES[FAMILY].parameters)
    assert (named["lanes_left"], named["cutter_body"], named["ego_speed_mps"]) == (-1.0, "van", 22.0)
    assert "side" not in named


@pytest.fixture
def sweep(tmp_path):
    """A run of four scenes over two parameters."""
    outcomes = (Outcome.SAFE, Outcome.FAILURE, Outcome.FAILURE, Outcome.REJECTED)
    records = [
        record(
            outcome,
            i,
            r157=i < 2,
            scene=SCENE | {"ego_speed_mps": 22.0 + 6 * (i // 2), "cutter_ahead_m": 10.0 * (i % 2)},
        )
        for i, outcome in enumerate(outcomes)
    ]
    write_results(tmp_path, RunResults(spec=SPEC, spec_digest=SPEC.digest, finished=False))
    (tmp_path / EPISODES).write_text("".join(f"{stored(each)}\n" for each in records))
    return tmp_path


def test_a_table_has_a_row_for_each_scene(sweep):
    (grid,) = played_grids([sweep])
    assert [count for count in grid.counts.values() if count] == [1, 1, 1, 1]
    rows = list(csv.DictReader(io.StringIO(grid_csv([grid]))))
    assert [row["verdict"] for row in rows] == ["pass", "fail", "out_of_scope", "refused"]
    assert [row["r157"] for row in rows] == ["yes", "yes", "no", ""]
    assert [(row["ego_speed_mps"], row["cutter_ahead_m"]) for row in rows[1:3]] == [("22", "10"), ("28", "0")]


def test_runs_of_other_methods_are_refused(sweep):
    other = SPEC.model_copy(update={"method": "random"})
    write_results(sweep, RunResults(spec=other, spec_digest=other.digest, finished=False))
    with pytest.raises(ConfigError, match="random"):
        played_grids([sweep])


def test_the_command_writes_a_table_a_report_and_a_picture(sweep, tmp_path, capsys):
    files = {kind: tmp_path / f"points.{kind}" for kind in ("csv", "xml", "png")}
    flags = ["--csv", str(files["csv"]), "--junit", str(files["xml"]), "--picture", str(files["png"])]
    assert cli.main(["grid", str(sweep), *flags, "--json"]) == 0
    (grid,) = json.loads(capsys.readouterr().out)
    assert [point["verdict"] for point in grid["points"]] == ["pass", "fail", "out_of_scope", "refused"]
    cases = [case for suite in JUnitXml.fromfile(str(files["xml"])) for case in suite]
    assert [(len(case.result), case.is_skipped) for case in cases] == [(0, False), (1, False), (1, True), (1, True)]
    assert len({case.classname for case in cases}) == 2  # a group for each speed
    assert files["png"].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("flags", "field"),
    [
        (["--over", "ego_speed_mps", "gap"], "--over"),
        (["--at", "ego_speed_mps=99"], "--at"),
        (["--at", "ego_speed_mps"], "--at"),
    ],
)
def test_a_picture_of_nothing_is_refused_in_one_line(sweep, tmp_path, capsys, flags, field):
    assert cli.main(["grid", str(sweep), "--picture", str(tmp_path / "a.png"), *flags]) == 2
    complaint = capsys.readouterr().err.strip()
    assert complaint.startswith(field)
    assert "\n" not in complaint
