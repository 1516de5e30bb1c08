"""The picture of a signature: all of its strokes, and text that is only text."""

from xml.etree import ElementTree

import pytest
from pydantic import ValidationError
from skyway_gateway.proofs.signature import Signature


def test_every_stroke_is_drawn_and_a_dot_too() -> None:
    signature = Signature(strokes=(((0, 0), (1000, 400)), ((5, 6),)))

    drawn = ElementTree.fromstring(signature.svg)

    lines = [each.get("points") for each in drawn.iter() if each.tag.endswith("polyline")]
    assert lines == ["0,0 1000,400 1000,400", "5,6 5,6"]


def test_a_name_cannot_add_markup() -> None:
    signature = Signature(name="</text><script>alert(1)</script>")

    drawn = ElementTree.fromstring(signature.svg)

    assert not [each for each in drawn.iter() if each.tag.endswith("script")]


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"strokes": [[[1, 2]]], "name": "Ada"},
        {"strokes": [[[1001, 2]]]},
        {"strokes": [[[1, -1]]]},
        {"strokes": [[]]},
        {"strokes": [[[1, 2]]] * 101},
        {"strokes": [[[1, 2]] * 1_001] * 2},
        {"name": "two\nlines"},
    ],
)
def test_a_signature_outside_of_its_limits_is_refused(given: object) -> None:
    with pytest.raises(ValidationError):
        Signature.model_validate(given)
