"""Import of scenario and variation files into documents."""

from pathlib import Path

import pytest

from risk_sac.config.base import Chosen
from risk_sac.config.scenario import AllOf, AnyOf
from risk_sac.config.story_actions import FollowTrajectoryAction, LanePosition, Polyline, RelativeLanePosition
from risk_sac.openscenario.scenario_file import Imported, import_scenario
from risk_sac.scenario.check import check_document
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.library import written
from risk_sac.scenario.reading import document_from, nets_of
from tests.openscenario_samples import SCENARIO, VARIATION, copied

RANGE = '<DistributionRange stepWidth="10"><Range lowerLimit="40" upperLimit="80"/></DistributionRange>'
DECLARED = '<ParameterDeclaration name="side"'


def of(folder: Path, file: str, *changes: tuple[str, str, str], ego: str | None = None) -> Imported:
    return import_scenario(copied(folder, *changes) / file, ego=ego)


def test_an_imported_document_passes_its_check_and_survives_writing(tmp_path: Path) -> None:
    imported = of(tmp_path, VARIATION)
    for name, content in imported.files.items():
        (tmp_path / name).write_bytes(content)
    check_document(imported.document, nets_of(imported.document, tmp_path))
    assert document_from(written(imported.document)) == imported.document


def test_the_same_files_give_the_same_net(tmp_path: Path) -> None:
    first, second = (of(tmp_path / str(i), SCENARIO) for i in range(2))
    assert first == second


@pytest.mark.usefixtures("quick")
class TestParameters:
    def test_a_file_without_variation_has_constants_alone(self, tmp_path: Path) -> None:
        document = of(tmp_path, SCENARIO).document
        assert {name: one.value for name, one in document.parameters.items()} == {
            "Ego_kph": 72.0,
            "_ego": "Ego_kph / 3.6",
            "gap": 20.0,
            "side": -1.0,
            "brakes": 0.0,
        }
        assert document.constraints == ()

    def test_ranges_sets_and_value_sets_become_axes(self, tmp_path: Path) -> None:
        imported = of(tmp_path, VARIATION)
        parameters = imported.document.parameters
        assert (parameters["Ego_kph"].range, parameters["Ego_kph"].step) == ((40.0, 80.0), 10.0)
        assert parameters["model"].words == ("wagon", "lorry_long")
        assert parameters["value_sets_1"].rows == ({"side": -1.0, "gap": 15.0}, {"side": -1.0, "gap": 25.0})
        assert imported.points == 5 * 2 * 2

    def test_a_set_of_numbers_keeps_its_name(self, tmp_path: Path) -> None:
        numbers = '<DistributionSet><Element value="40"/><Element value="55"/></DistributionSet>'
        parameters = of(tmp_path, VARIATION, (VARIATION, RANGE, numbers)).document.parameters
        assert parameters["Ego_kph"].rows == ({"Ego_kph": 40.0}, {"Ego_kph": 55.0})

    def test_a_single_value_is_a_constant(self, tmp_path: Path) -> None:
        single = '<DistributionSet><Element value="50"/></DistributionSet>'
        parameters = of(tmp_path, VARIATION, (VARIATION, RANGE, single)).document.parameters
        assert parameters["Ego_kph"].value == 50.0

    def test_a_range_of_whole_numbers_is_a_row_for_each(self, tmp_path: Path) -> None:
        text = 'parameterName="side"><DistributionRange stepWidth="1"><Range lowerLimit="-2" upperLimit="0"/>'
        whole = (VARIATION, f'parameterName="Ego_kph">\n        {RANGE}', f"{text}</DistributionRange>")
        sets = (VARIATION, '<ParameterAssignment parameterRef="side" value="-1"/>', "")
        parameters = of(tmp_path, VARIATION, whole, sets, sets).document.parameters
        assert parameters["side"].rows == ({"side": -2.0}, {"side": -1.0}, {"side": 0.0})

    def test_groups_are_joined_by_or_and_their_members_by_and(self, tmp_path: Path) -> None:
        document = of(tmp_path, VARIATION).document
        assert document.constraints == (
            AllOf(all=("Ego_kph > 0.0", "Ego_kph <= 130.0")),
            AnyOf(any=("gap >= _ego / 2", AllOf(all=("gap <= 5.0", "gap >= 5.0")))),
        )

    def test_a_number_that_chooses_a_road_chooses_by_words_too(self, tmp_path: Path) -> None:
        roads = (SCENARIO, 'roadId="7" laneId="-1"', 'roadId="$gap" laneId="-1"')
        document = of(tmp_path, VARIATION, roads).document
        position = document.ego.start.position
        assert isinstance(position, LanePosition)
        assert position.road == Chosen[str](by="gap_word", of={"_15": "15", "_25": "25"})
        assert document.parameters["value_sets_1"].rows[1] == {"gap": 25.0, "gap_word": "_25", "side": -1.0}  # type: ignore[index]

    def test_words_that_constraints_forbid_are_left_out(self, tmp_path: Path) -> None:
        group = '<ConstraintGroup><ValueConstraint rule="notEqualTo" value="lorry-long"/></ConstraintGroup>'
        old = '<ParameterDeclaration name="model" parameterType="string" value="wagon"/>'
        new = f'<ParameterDeclaration name="model" parameterType="string" value="wagon">{group}</ParameterDeclaration>'
        document = of(tmp_path, VARIATION, (SCENARIO, old, new)).document
        assert "model" not in document.parameters
        assert document.origin is not None
        assert any("lorry-long" in remark for remark in document.origin.remarks)

    def test_roads_that_are_not_there_are_left_out_by_name(self, tmp_path: Path) -> None:
        elements = "".join(f'<Element value="{name}"/>' for name in ("road.xodr", "other.xodr"))
        road = f'<DeterministicSingleParameterDistribution parameterName="road"><DistributionSet>{elements}'
        road += "</DistributionSet></DeterministicSingleParameterDistribution>"
        imported = of(tmp_path, VARIATION, (VARIATION, "<Deterministic>", f"<Deterministic>{road}"))
        assert imported.document.road == "road.xodr"
        assert imported.document.origin is not None
        assert any("other.xodr" in remark for remark in imported.document.origin.remarks)
        assert imported.points == 40

    def test_of_two_roads_a_word_chooses_net_and_road(self, tmp_path: Path) -> None:
        elements = "".join(f'<Element value="{name}"/>' for name in ("road.xodr", "second.xodr"))
        road = f'<DeterministicSingleParameterDistribution parameterName="road"><DistributionSet>{elements}'
        road += "</DistributionSet></DeterministicSingleParameterDistribution>"
        there = copied(tmp_path, (VARIATION, "<Deterministic>", f"<Deterministic>{road}"))
        (there / "second.xodr").write_bytes((there / "road.xodr").read_bytes())
        imported = import_scenario(there / VARIATION)
        assert imported.document.network == Chosen[str](
            by="road", of={"road": "road.net.xml", "second": "second.net.xml"}
        )
        assert sorted(imported.files) == ["road.net.xml", "road.xodr", "second.net.xml", "second.xodr"]


@pytest.mark.usefixtures("quick")
class TestActors:
    def test_starts_speeds_and_bodies_follow_the_file(self, tmp_path: Path) -> None:
        document = of(tmp_path, VARIATION).document
        cutting = document.actors["Cutting_in"]
        assert isinstance(cutting.start.position, RelativeLanePosition)
        assert (cutting.start.position.to, cutting.start.position.ds_m) == ("ego", "gap + 5")
        value = Interpreter(document, {}).value({"Ego_kph": 72.0, "model": 0.9, "value_sets_1": 0.1})
        assert value.of(cutting.speed) == pytest.approx(17.0)
        assert value.choose(cutting.body) == "truck"
        assert value.choose(cutting.box).ahead_m == 4.0
        assert document.actors["Walker"].moves == "freely"
        assert document.actors["Box"].role == "static"

    def test_the_ego_is_called_ego_has_a_controller_or_is_named(self, tmp_path: Path) -> None:
        assert "Cutting_in" in of(tmp_path / "a", SCENARIO).document.actors
        renamed = [(SCENARIO, '"Ego"', '"Own"')] * 6
        controller = (SCENARIO, 'entryName="wagon"/>', 'entryName="wagon"/><ObjectController/>')
        assert of(tmp_path / "b", SCENARIO, *renamed, controller).document.origin.actors["ego"] == "Own"  # type: ignore[union-attr]
        named = of(tmp_path / "c", SCENARIO, ego="Cutting in").document
        assert named.origin.actors == {"ego": "Cutting in", "Ego": "Ego", "Walker": "Walker", "Box": "Box"}  # type: ignore[union-attr]

    def test_values_assigned_to_an_entry_reach_its_expressions(self, tmp_path: Path) -> None:
        document = of(tmp_path, SCENARIO).document
        assert document.story is not None
        line = document.story.trajectories["across"]
        assert isinstance(line, Polyline)
        place = line.vertices[0].position
        assert place.kind == "road"
        value = Interpreter(document, {}).value({})
        assert [value.of(place.s_m), value.of(place.t_m)] == pytest.approx([220.0, -8.4])

    def test_an_entry_with_other_values_is_another_trajectory(self, tmp_path: Path) -> None:
        private = '<Private entityRef="Box">'
        follow = (
            "<PrivateAction><RoutingAction><FollowTrajectoryAction><TimeReference><None/></TimeReference>"
            '<TrajectoryFollowingMode followingMode="position"/><TrajectoryRef>'
            '<CatalogReference catalogName="ways" entryName="across"/></TrajectoryRef>'
            "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
        )
        story = of(tmp_path, SCENARIO, (SCENARIO, private, private + follow)).document.story
        assert story is not None
        assert list(story.trajectories) == ["across", "across 2"]
        names = [one.do.trajectory for one in story.init if isinstance(one.do, FollowTrajectoryAction)]
        assert names == ["across", "across 2"]


@pytest.mark.usefixtures("quick")
def test_the_time_that_ends_the_scenario_is_the_horizon(tmp_path: Path) -> None:
    document = of(tmp_path, SCENARIO).document
    assert Interpreter(document, {}).value({}).of(document.horizon_s) == 14.0


@pytest.mark.usefixtures("quick")
def test_what_is_not_read_is_told_by_element_and_line(tmp_path: Path) -> None:
    document = of(tmp_path, SCENARIO).document
    assert document.origin is not None
    assert any("cut_in.xosc, line 143, <AppearanceAction>" in remark for remark in document.origin.remarks)
    assert any("bodies.xosc, line 10, <Performance>" in remark for remark in document.origin.remarks)
