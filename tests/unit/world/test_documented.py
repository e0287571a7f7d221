from risk_sac.world.documented import Documented


class Shape(Documented):
    corners: int
    """How many,
    the first one counted once."""
    closed: bool
    """Whether the last one is the first."""


class Square(Shape):
    corners: int = 4
    side_m: float
    """Of each."""


def test_the_string_below_a_field_describes_it_until_a_subclass_declares_the_field_again():
    assert {name: field.get("description") for name, field in Square.model_json_schema()["properties"].items()} == {
        "corners": None,
        "closed": "Whether the last one is the first.",
        "side_m": "Of each.",
    }
    assert Shape.model_json_schema()["properties"]["corners"]["description"] == "How many,\nthe first one counted once."


def test_a_model_is_built_when_it_is_first_used():
    class Point(Documented):
        x_m: float

    assert not Point.__pydantic_complete__
    assert Point.model_validate({"x_m": 1}).x_m == 1.0
    assert Point.__pydantic_complete__
