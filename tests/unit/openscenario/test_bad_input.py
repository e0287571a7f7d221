"""Faults of a scenario are reported by file, line and element."""

import io
import re
import zipfile
from pathlib import Path

import pytest

from risk_sac.errors import ConfigError
from risk_sac.openscenario.scenario_file import import_scenario
from risk_sac.openscenario.sources import holds_scenario, unpack
from tests.openscenario_samples import BODIES, FILES, SCENARIO, VARIATION, WAYS, copied

pytestmark = pytest.mark.usefixtures("quick")
TELEPORT = '<TeleportAction><Position><WorldPosition x="300" y="-12" h="0.5"/></Position></TeleportAction>'
VERTEX = '<Vertex><Position><RoadPosition roadId="7" s="$at" t='
RANGE = '<DistributionRange stepWidth="10"><Range lowerLimit="40" upperLimit="80"/></DistributionRange>'
FAULTS = {  # change, element or file that is named, and a piece of what was got
    "a text": ((SCENARIO, "<?xml", "no <?xml"), SCENARIO, "well-formed"),
    "another root": ((SCENARIO, "<OpenSCENARIO>", "<OpenSCENARIO></OpenSCENARIO><x>"), SCENARIO, "well-formed"),
    "a document type": (
        (SCENARIO, "<OpenSCENARIO>", '<!DOCTYPE x SYSTEM "file:///x"><OpenSCENARIO>'),
        SCENARIO,
        "DOCTYPE",
    ),
    "an unknown version": ((SCENARIO, 'revMinor="3"', 'revMinor="9"'), "<FileHeader>", "1.9"),
    "no road": ((SCENARIO, '<LogicFile filepath="$road"/>', ""), "<RoadNetwork>", "no child"),
    "a missing road": ((SCENARIO, 'value="road.xodr"', 'value="none.xodr"'), "<LogicFile>", "none.xodr"),
    "a road elsewhere": ((SCENARIO, 'value="road.xodr"', 'value="/etc/passwd"'), "<LogicFile>", "outside"),
    "a catalog elsewhere": ((SCENARIO, 'path="catalogs"', 'path="../.."'), "<Directory>", "outside"),
    "an unknown catalog": ((SCENARIO, 'catalogName="ways"', 'catalogName="way"'), "<CatalogReference>", "'way'"),
    "an unknown entry": ((SCENARIO, 'entryName="adult"', 'entryName="child"'), "<CatalogReference>", "'child'"),
    "a body for a route": ((SCENARIO, 'entryName="along"', 'entryName="across"'), "<CatalogReference>", "a Trajectory"),
    "no value": ((SCENARIO, '"int" value="-1"', '"int"'), "<ParameterDeclaration>", "without a value"),
    "no type": ((SCENARIO, 'parameterType="int"', ""), "<ParameterDeclaration>", "parameterType ''"),
    "a word for a number": ((SCENARIO, '"int" value="-1"', '"int" value="left"'), "<ParameterDeclaration>", "'left'"),
    "a broken constraint": (
        (SCENARIO, 'name="gap" parameterType="double" value="20"', 'name="gap" parameterType="double" value="7"'),
        "<ParameterDeclaration>",
        "'7', which breaks",
    ),
    "a parameter twice": ((SCENARIO, 'name="side"', 'name="gap"'), "<ParameterDeclaration>", "once more"),
    "a cycle of parameters": (
        (SCENARIO, '"double" value="72"', '"double" value="$_ego"'),
        "<ParameterDeclaration>",
        "name each other",
    ),
    "an unknown parameter": ((SCENARIO, "${$gap + 5}", "${$gab + 5}"), "<RelativeLanePosition>", "$gab"),
    "code": ((SCENARIO, "${$gap + 5}", "${__import__('os')}"), "<RelativeLanePosition>", "no"),
    "a division by zero": ((SCENARIO, "${$Ego_kph / 3.6}", "${1 / 0}"), "<ParameterDeclaration>", "division"),
    "an expression without end": ((SCENARIO, "${$gap + 5}", "${$gap + 5"), "<RelativeLanePosition>", "${$gap + 5"),
    "an entity twice": (
        (SCENARIO, '<ScenarioObject name="Walker">', '<ScenarioObject name="Box">'),
        "<ScenarioObject>",
        "once more",
    ),
    "no start": (
        (SCENARIO, TELEPORT, '<VisibilityAction graphics="true" traffic="true" sensors="true"/>'),
        "<ScenarioObject>",
        "without a start",
    ),
    "an unread start": (
        (SCENARIO, '<WorldPosition x="300" y="-12" h="0.5"/>', '<GeoPosition latitudeDeg="1" longitudeDeg="2"/>'),
        "<GeoPosition>",
        "not read",
    ),
    "no ego": ((SCENARIO, '<ScenarioObject name="Ego">', '<ScenarioObject name="Own">'), "<Entities>", "no entity"),
    "starts in a circle": (
        (
            SCENARIO,
            '<LanePosition roadId="7" laneId="-1" s="50" offset="0.2"/>',
            '<RelativeObjectPosition entityRef="Cutting in" dx="1" dy="0"/>',
        ),
        "<Init>",
        "relative to each other",
    ),
    "times at some points": (
        (WAYS, f"<Vertex>{VERTEX[8:]}", f'<Vertex time="1">{VERTEX[8:]}'),
        "<Polyline>",
        "times at some",
    ),
    "an entry's unknown value": ((SCENARIO, 'parameterRef="at"', 'parameterRef="where"'), "<Trajectory>", "'where'"),
    "an unknown shape": (
        (SCENARIO, 'dynamicsShape="sinusoidal"', 'dynamicsShape="round"'),
        "<LaneChangeActionDynamics>",
        "'round'",
    ),
    "an unknown rule": (
        (SCENARIO, 'freespace="true" rule="lessThan"', 'freespace="true" rule="below"'),
        "<RelativeDistanceCondition>",
        "'below'",
    ),
    "no size": ((BODIES, '<Dimensions width="1.8" length="4.8" height="1.6"/>', ""), "<BoundingBox>", "only <Center>"),
    "a negative size": ((BODIES, 'length="4.8"', 'length="-4.8"'), "<BoundingBox>", "length_m"),
    "an unknown varied parameter": (
        (VARIATION, 'parameterName="Ego_kph"', 'parameterName="Ego"'),
        "<DeterministicSingleParameterDistribution>",
        "'Ego'",
    ),
    "a parameter varied twice": (
        (VARIATION, 'parameterName="model"', 'parameterName="Ego_kph"'),
        "<DeterministicSingleParameterDistribution>",
        "once more",
    ),
    "a range upside down": ((VARIATION, 'lowerLimit="40"', 'lowerLimit="90"'), "<Range>", "90"),
    "a step of zero": ((VARIATION, 'stepWidth="10"', 'stepWidth="0"'), "<DistributionRange>", "stepWidth"),
    "a grid of 1e9 points": (
        (VARIATION, 'stepWidth="10"', 'stepWidth="0.0000001"'),
        "<ParameterValueDistribution>",
        "1.6e+09",
    ),
    "a missing scenario": ((VARIATION, "cut_in.xosc", "cut_out.xosc"), "<ScenarioFile>", "cut_out.xosc"),
    "values that differ": (
        (VARIATION, '<ParameterAssignment parameterRef="gap" value="15"/>', ""),
        "<ParameterValueSet>",
        "values of",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_told_with_its_place(tmp_path: Path, fault: str) -> None:
    change, place, got = FAULTS[fault]
    there = copied(tmp_path, change)
    file = VARIATION if change[0] == VARIATION else SCENARIO
    with pytest.raises(ConfigError) as told:
        import_scenario(there / file, within=there)
    assert place in told.value.field
    assert got in told.value.got
    if named := re.match(r"(\S+), line (\d+), (<\w+)>", told.value.field):
        (path,) = there.rglob(named[1])
        assert named[3] in path.read_text().splitlines()[int(named[2]) - 1]
    assert "\n" not in str(told.value)


def test_two_controllers_without_an_ego_are_refused(tmp_path: Path) -> None:
    twice = ("Cutting in", "Walker")
    changes = [
        (SCENARIO, f'<ScenarioObject name="{name}">', f'<ScenarioObject name="{name}"><ObjectController/>')
        for name in twice
    ]
    there = copied(tmp_path, *changes, *[(SCENARIO, '"Ego"', '"Own"')] * 6)
    with pytest.raises(ConfigError) as told:
        import_scenario(there / SCENARIO)
    assert told.value.got == "2 egos: Cutting in, Walker"


def test_a_catalog_alone_is_no_scenario(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as told:
        import_scenario(copied(tmp_path) / BODIES)
    assert "Catalog" in told.value.got


def test_trajectories_within_each_other_end(tmp_path: Path) -> None:
    inner = '<TrajectoryPosition s="1"><TrajectoryRef><CatalogReference catalogName="ways" entryName="across"/>'
    place = (WAYS, '<RoadPosition roadId="7" s="$at" t="$from"/>', f"{inner}</TrajectoryRef></TrajectoryPosition>")
    with pytest.raises(ConfigError) as told:
        import_scenario(copied(tmp_path, place) / SCENARIO)
    assert "within each other" in told.value.got


class TestArchives:
    def archive(self, **others: str) -> bytes:
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            for file in sorted(FILES.rglob("*.x*")):
                archive.write(file, file.relative_to(FILES))
            for name, text in others.items():
                archive.writestr(name, text)
        return buffer.getvalue()

    def test_the_variation_file_is_the_one_that_is_imported(self, tmp_path: Path) -> None:
        upload = self.archive()
        assert holds_scenario(upload)
        assert unpack(upload, tmp_path) == tmp_path / VARIATION

    def test_other_files_are_not_written(self, tmp_path: Path) -> None:
        unpack(self.archive(**{"notes.txt": "x"}), tmp_path)
        assert not (tmp_path / "notes.txt").exists()

    @pytest.mark.parametrize("name", ["../x.xosc", "/x.xosc", "a/../../x.xosc", "c:x.xosc"])
    def test_a_name_that_leaves_the_archive_is_refused(self, tmp_path: Path, name: str) -> None:
        inside = tmp_path / "inside"
        inside.mkdir()
        with pytest.raises(ConfigError):
            unpack(self.archive(**{name: "x"}), inside)
        assert [path.name for path in tmp_path.iterdir()] == ["inside"]

    def test_two_variation_files_are_refused_by_name(self, tmp_path: Path) -> None:
        with pytest.raises(ConfigError) as told:
            unpack(self.archive(**{"second.xosc": (FILES / VARIATION).read_text()}), tmp_path)
        assert "second.xosc" in told.value.got
