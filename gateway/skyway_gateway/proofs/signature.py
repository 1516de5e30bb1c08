"""The signature of a recipient: drawn strokes, or a typed name, and its picture."""

from typing import Annotated, Final, Self
from xml.sax.saxutils import escape

from pydantic import Field, model_validator

from skyway.json_model import JsonModel
from skyway_gateway.personal_data.details import Name

#: The field for a signature, in its own units.
WIDTH: Final = 1000
HEIGHT: Final = 400

MOST_STROKES: Final = 100
MOST_POINTS: Final = 2_000

_X = Annotated[int, Field(ge=0, le=WIDTH)]
_Y = Annotated[int, Field(ge=0, le=HEIGHT)]
_Stroke = Annotated[tuple[tuple[_X, _Y], ...], Field(min_length=1, max_length=MOST_POINTS)]


class Signature(JsonModel):
    """Strokes of a pen or a finger, or the name that a person has typed instead."""

    strokes: Annotated[
        tuple[_Stroke, ...],
        Field(
            max_length=MOST_STROKES,
            description="Up to 100 strokes with up to 2000 points together: x from 0 to 1000, y "
            "from 0 to 400, downwards.",
        ),
    ] = ()
    name: Annotated[Name | None, Field(description="The typed name of the person who signs.")] = (
        None
    )

    @model_validator(mode="after")
    def _is_one_of_two(self) -> Self:
        if bool(self.strokes) == (self.name is not None):
            raise ValueError("needs either strokes or a name")
        points = sum(map(len, self.strokes))
        if points > MOST_POINTS:
            raise ValueError(f"has {points} points; at most {MOST_POINTS} are allowed")
        return self

    @property
    def svg(self) -> str:
        """The picture of the signature."""
        name = self.name and (
            f'<text x="40" y="{HEIGHT // 2}" font-size="64" font-style="italic">'
            f"{escape(self.name)}</text>"
        )
        lines = "".join(f'<polyline points="{_points(each)}"/>' for each in self.strokes)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}">'
            f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>{name or ""}'
            '<g fill="none" stroke="#000" stroke-width="6" stroke-linecap="round" '
            f'stroke-linejoin="round">{lines}</g></svg>'
        )


def _points(stroke: tuple[tuple[int, int], ...]) -> str:
    # A single point is drawn as a dot: a line from the point to itself.
    return " ".join(f"{x},{y}" for x, y in (*stroke, stroke[-1]))
