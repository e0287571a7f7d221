import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from risk_sac.config import CampaignSpec, EgoConfig, Iid
from risk_sac.config.spec_file import campaign_yaml
from risk_sac.failures.studied import Case, Regression, Verdict
from risk_sac.records import Grade
from risk_sac.report import compare
from risk_sac.report.document import Origin, gathered, report_page
from risk_sac.report.files import read_folders
from risk_sac.report.statistics import played_by, power_of
from risk_sac.run_folder.results import RunResults, write_results
from risk_sac.scenario.families import FAMILIES

HOSTILE = (
    '<script>alert(1)</script><img src=x onerror=y> "q" `tick` [link](javascript:a) |cell| \u202egnp.exe \x07 &amp;'
)


def origin(**more):
    return Origin(
        report="risk-sac report runs --out report.html",
        data="risk-sac report runs --out report.json",
        show=lambda run, failure: f"risk-sac show {run.spec.id} {failure}",
        regress="risk-sac regress --failures runs --ego EGO",
        **more,
    )


def power(comparison):
    return power_of(comparison.spec, played_by(comparison.runs))


def both(comparison, **more):
    content = comparison, gathered(comparison), origin(**more), power(comparison)
    return report_page(*content, "html"), report_page(*content, "markdown")


def drawn(finished, run, letters):
    made = finished(run, letters)
    scene = {parameter.name: parameter.high for parameter in FAMILIES[run.family].space.parameters}
    fresh = {"phase": "iid", "scene": scene}
    return replace(made, records=tuple(record.model_copy(update=fresh) for record in made.records))


@pytest.fixture
def told(spec, runs, finished):
    """A campaign that ended with an i.i.d. phase."""
    ends = spec.model_copy(update={"iid": Iid(episodes=8)})
    fresh = [drawn(finished, run, letters) for run, letters in zip(ends.drawn(), ("........", "r..f...d"), strict=True)]
    return compare(ends, [*runs, *fresh], "risk-sac evaluate --iid 8")


class Tags(HTMLParser):
    """Which elements a page has, with their attributes, and its text."""

    def __init__(self, text):
        super().__init__()
        self.found, self.text = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))

    def handle_data(self, data):
        self.text += data


def test_an_i_i_d_phase_is_in_no_other_number(told, spec, runs):
    without = compare(spec, runs, "")
    assert told.cells == without.cells
    assert told.overviews == without.overviews
    assert told.tests == without.tests
    evidence = gathered(told)
    assert evidence.coverage["low"].search == gathered(without).coverage["low"].search
    assert evidence.coverage["low"].iid.episodes == 15
    assert gathered(without).bounds == ()


def test_runs_that_are_missing_are_named_with_the_reason(told, spec):
    some = compare(told.spec, [*told.runs[1:], told.drawn[0]], "", reasons={told.runs[0].spec.digest: "its disk died"})
    page, text = both(some)
    for each in (Tags(page).text, text):
        assert "5 of 6 searches; 1 of 2 of the i.i.d. phase" in each
        assert "its disk died" in each
    assert "| low | iid-random | 0 | not finished |" in text
    nothing = compare(told.spec, [], "")
    for each in both(nothing):
        assert "0 of 6 searches" in each
        assert "No run of it has finished." in each


def test_what_users_write_is_shown_and_is_no_markup(told):
    spec = CampaignSpec.model_validate(told.spec.model_dump() | {"label": HOSTILE})
    case = Case(id="x", digest="d", name=HOSTILE, grade=Grade.PREVENTABLE, verdict=Verdict.FIXED, reason=HOSTILE)
    regression = Regression(ego=EgoConfig(), cases=(case,))
    reasons = {run.digest: HOSTILE for run in spec.runs()}
    page, text = both(compare(spec, [], HOSTILE, reasons=reasons), regression=regression)
    tags = Tags(page)
    names = {tag for tag, _ in tags.found}
    assert not names & {"script", "img", "iframe", "object", "link", "form"}
    assert not any(name.startswith("on") for _, attributes in tags.found for name in attributes)
    assert tags.text.count("<script>alert(1)</script>") >= 8
    prose = re.sub(r"(?ms)^(`{3,})$.*?^\1$", "", text)  # without the commands
    assert "<script" not in prose
    assert "](" not in prose.replace("\\](", "")
    assert len([line for line in prose.splitlines() if line.startswith("| low ") and "\\|cell\\|" in line]) == 8
    for each in (page, text):
        assert "\u202e" not in each
        assert "\x07" not in each
    assert text.count("\n# ") == 0  # but for the title in the first line, nothing made itself one


def test_the_page_needs_nothing_else_and_two_make_the_same(told):
    page, text = both(told)
    assert (page, text) == both(told)
    tags = Tags(page).found
    policy = next(attributes["content"] for tag, attributes in tags if attributes.get("http-equiv"))
    assert policy.startswith("default-src 'none'")
    assert all(attributes["href"].startswith("#") for tag, attributes in tags if tag == "a")
    ids = [attributes["id"] for _, attributes in tags if "id" in attributes]
    assert len(set(ids)) == len(ids)
    assert {attributes["href"][1:] for tag, attributes in tags if tag == "a"} <= set(ids)
    assert "src=" not in page  # the failures' series were never written


def test_a_picture_that_cannot_be_had_is_said_to_be_missing(told, tmp_path):
    for text in both(told, folders={run.spec.digest: tmp_path for run in told.runs})[:1]:
        assert "No picture: its time series is gone." in text
    series = tmp_path / "failures" / "000000.npz"
    series.parent.mkdir()
    series.write_bytes(b"PK\x03\x04 damaged")
    assert "is damaged" in both(told, folders={run.spec.digest: tmp_path for run in told.runs})[0]
    assert "the folder of its run is missing" in both(told)[0]


def test_a_campaigns_folder_is_told_with_what_is_unfinished_or_damaged_in_it(tmp_path):
    spec = CampaignSpec.model_validate({"families": ["low"], "methods": ["random"], "seeds": [0, 1], "iid": {}})
    (tmp_path / "spec.yaml").write_text(campaign_yaml(spec))
    for run in spec.runs()[:2]:
        (tmp_path / "runs" / run.id).mkdir(parents=True)
        write_results(tmp_path / "runs" / run.id, RunResults(spec=run, spec_digest=run.digest, finished=False))
    damaged = tmp_path / "runs" / spec.runs()[1].id / "results.json"
    damaged.write_bytes(damaged.read_bytes()[:-9])
    found = read_folders([tmp_path]).comparison
    assert [(run.seed, run.reason.partition(" in ")[0]) for run in found.missing] == [
        (0, "the run"),
        (1, "not finished"),
    ]
    assert "is not finished" in found.missing[0].reason
    assert [run.method for run in found.undrawn] == ["iid-undisturbed", "iid-random"]


def test_a_family_whose_place_on_a_map_is_gone_is_named_and_the_others_are_told(spec, monkeypatch, tmp_path):
    monkeypatch.setenv("RISK_SAC_PLACES", str(tmp_path))
    gone = CampaignSpec.model_validate(spec.model_dump() | {"families": ("low", "junction_0123456789ab")})
    for text in both(compare(gone, [], "")):
        assert "junction_0123456789ab: family: got" in text
        assert "scenery.speed_limit_mps" in text


def test_an_ego_is_told_with_its_driver_sight_and_defects(spec):
    ego = {"driver": "idm", "defects": ("latency", "speeds"), "sensor": {"range_m": 30, "field_of_view_rad": 3.1416}}
    told = compare(CampaignSpec.model_validate(spec.model_dump() | {"ego": ego}), [], "")
    _, text = both(told, regression=Regression(ego=EgoConfig(profile="perfect"), cases=()))
    assert "registered driver idm, responds within 0.5 s, sees 30 m far over 180°" in text
    assert "with the planted defects latency and speeds" in text
    assert "decides every 0.1 s, sees everything" in text
