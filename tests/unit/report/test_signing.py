"""The digest of a report's inputs, and which of them changed."""

import hashlib

import pytest

from risk_sac import cli
from risk_sac.config import CampaignSpec
from risk_sac.config.spec_file import campaign_yaml
from risk_sac.errors import ConfigError
from risk_sac.report import files as signing
from risk_sac.report.files import changes, input_digests, inputs_in, manifest, signed
from risk_sac.run_folder.results import RunResults, write_results

SPEC = CampaignSpec(families=("low",), methods=("random",))


@pytest.fixture
def folder(tmp_path):
    """A run with all files that a report reads."""
    for name in ("results.json", "episodes.jsonl", "verified.json", "failures/000001.npz", "studies/core.json"):
        path = tmp_path / "low-random-0" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    return tmp_path / "low-random-0"


def now(folder, spec=SPEC, **more):
    return signed(input_digests(spec, [folder], code=more.pop("code", "c" * 64), **more))


def test_the_digest_is_that_of_the_lines(folder):
    made = now(folder)
    lines = manifest(made.inputs)
    assert made.digest == hashlib.sha256(lines.encode()).hexdigest()
    assert f"{hashlib.sha256(b'episodes.jsonl').hexdigest()}  low-random-0/episodes.jsonl\n" in lines
    assert [one.name for one in made.inputs] == sorted(one.name for one in made.inputs)


@pytest.mark.parametrize(
    "name", ["results.json", "episodes.jsonl", "verified.json", "failures/000001.npz", "studies/core.json"]
)
def test_each_file_of_a_run_changes_the_digest_and_is_named(folder, name):
    before = now(folder)
    (folder / name).write_text("other")
    named = f"low-random-0/{name.partition('/')[0]}{'/' if '/' in name else ''}"
    assert now(folder).digest != before.digest
    assert changes(before, now(folder)) == [f"{named} (changed)"]
    (folder / name).unlink()
    assert changes(before, now(folder)) == [f"{named} (missing)"]


@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("campaign", {"spec": SPEC.model_copy(update={"label": "another"})}),
        ("code", {"code": "d" * 64}),
        ("regression", {"regression": "{}"}),
    ],
)
def test_campaign_code_and_regression_are_inputs(folder, name, more):
    (found,) = changes(now(folder), now(folder, **more))
    assert found.partition(" ")[0] == name


def test_scenarios_and_the_benchmark_are_inputs(folder, monkeypatch, tmp_path):
    before = now(folder)
    assert {"scenarios/low/low.yaml", "scenarios/low/low.net.xml"} <= {one.name for one in before.inputs}
    (tmp_path / "detections.csv").write_text("defects")
    monkeypatch.setattr(signing, "MEASURED", tmp_path / "detections.csv")
    monkeypatch.setattr(signing, "sources_named", lambda name: {"low.yaml": b"name: low"})
    assert changes(before, now(folder)) == [
        "benchmark (changed)",
        "scenarios/low/low.net.xml (missing)",
        "scenarios/low/low.yaml (changed)",
    ]


def test_a_manifest_that_was_edited_is_refused(folder):
    made = now(folder)
    text = f"- digest of all inputs: {made.digest}\n\n```\n{manifest(made.inputs)}```\n"
    assert inputs_in(text) == made
    with pytest.raises(ConfigError):
        inputs_in(text.replace("low-random-0/episodes", "low-random-1/episodes"))
    for nothing in ("", "{}", "{", '{"signed": 1}', "# A report"):
        with pytest.raises(ConfigError):
            inputs_in(nothing)


def test_verify_says_in_one_line_what_changed(tmp_path, capsys):
    (tmp_path / "spec.yaml").write_text(campaign_yaml(SPEC))
    run = SPEC.runs()[0]
    (tmp_path / "runs" / run.id).mkdir(parents=True)
    write_results(tmp_path / "runs" / run.id, RunResults(spec=run, spec_digest=run.digest, finished=False))
    for suffix in ("json", "html", "md"):
        assert cli.main(["report", str(tmp_path), "--out", str(tmp_path / f"report.{suffix}")]) == 0
        assert cli.main(["report", "verify", str(tmp_path / f"report.{suffix}")]) == 0
    assert cli.main(["report", "verify", str(tmp_path)]) == 0
    capsys.readouterr()
    (tmp_path / "runs" / run.id / "episodes.jsonl").write_text("{}")
    assert cli.main(["report", "verify", str(tmp_path / "report.html")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{run.id}/episodes.jsonl (new)" in line
    for words in ([], [str(tmp_path / "none.json"), str(tmp_path)], [str(tmp_path / "runs" / "x.json")]):
        assert cli.main(["report", "verify", *words]) != 0
        assert len(capsys.readouterr().err.splitlines()) == 1
