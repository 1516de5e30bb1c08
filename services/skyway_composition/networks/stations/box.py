"""A box on the map: between two meridians and two parallels."""

from dataclasses import dataclass
from typing import Final, Self

from pydantic import TypeAdapter, ValidationError

from skyway.geo import Position

_CORNER: Final[TypeAdapter[Position]] = TypeAdapter(Position)
_NUMBERS: Final = 4


@dataclass(frozen=True, slots=True)
class Box:
    """Two corners; over the date line the south-western one lies east of the other."""

    south_west: Position
    north_east: Position

    @classmethod
    def parse(cls, text: str) -> Self:
        """The box in ``west,south,east,north``, in degrees, as GeoJSON orders a `bbox`.

        Raises
        ------
        ValueError
            These are not four such numbers, or south lies north of north.
        """
        numbers = text.split(",")
        if len(numbers) != _NUMBERS:
            raise ValueError("must be west,south,east,north in degrees")
        try:
            box = cls(_corner(numbers[:2]), _corner(numbers[2:]))
        except ValidationError as error:
            raise ValueError("must be west,south,east,north in degrees") from error
        if box.south_west.latitude_deg > box.north_east.latitude_deg:
            raise ValueError("south must not lie north of north")
        return box

    @property
    def crosses_date_line(self) -> bool:
        """Whether it reaches from the far east to the far west."""
        return self.south_west.longitude_deg > self.north_east.longitude_deg


def _corner(numbers: list[str]) -> Position:
    return _CORNER.validate_python(tuple(numbers))
