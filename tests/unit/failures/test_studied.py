"""What was told of a run's failures, beside its results."""

from pathlib import Path

from risk_sac.failures.studied import STUDIES, Core, Extent, Studied, note, read_studies

CORE = Core(
    before=Extent(adversaries=2, segments=9, channels=12, strongest=1.0),
    after=Extent(adversaries=1, segments=3, channels=4, strongest=0.5),
    plain_parameters=5,
    parameters=9,
    episodes=100,
    held=9,
    copies=10,
    sentence="A walker steps out",
)


def test_of_other_results_or_damaged_nothing_is_told(tmp_path: Path) -> None:
    assert read_studies(tmp_path, "d") == {}
    note(tmp_path, "other", 3, Studied(core=CORE))
    note(tmp_path, "d", 4, Studied(core=CORE))
    for name, content in (("000005-core.json", "{"), ("5.json", "[]"), ("000006-twin.json", "{}")):
        (tmp_path / STUDIES / name).write_text(content)
    (tmp_path / STUDIES / "000004-core.json").rename(tmp_path / STUDIES / "4-x.json")
    assert read_studies(tmp_path, "d") == {}
