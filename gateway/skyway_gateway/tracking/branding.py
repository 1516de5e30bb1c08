"""How a customer's tracking pages look: the name of the shop, and its colour."""

from typing import Annotated, Final, Literal

from pydantic import AfterValidator, Field

from skyway.json_model import JsonModel
from skyway_gateway.personal_data.details import one_line

ShopName = Annotated[str, Field(min_length=1, max_length=60), AfterValidator(one_line)]
Colour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$", max_length=7)]

#: Added to both luminances of a contrast (Web Content Accessibility Guidelines 2.2).
_FLARE: Final = 0.05
#: What red, green and blue add to the luminance, by the same source.
_WEIGHTS: Final = (0.2126, 0.7152, 0.0722)


class Branding(JsonModel):
    """The name and the colour of a customer's shop on its tracking pages."""

    name: Annotated[
        ShopName | None,
        Field(description="One line of 1 to 60 characters; null: the page names no shop."),
    ] = None
    colour: Annotated[
        Colour | None,
        Field(
            description="The colour behind the name; null: the page's own colour.",
            examples=["#0b6bcb"],
        ),
    ] = None


class ShownBranding(Branding):
    """The branding as a tracking page shows it."""

    text_colour: Annotated[
        Literal["#000000", "#ffffff"] | None,
        Field(
            description="What is easier to read on the colour, with a contrast of at least 4.5 to 1"
        ),
    ] = None

    @classmethod
    def of(cls, branding: Branding) -> "ShownBranding":
        """The branding with the colour of its text."""
        colour = branding.colour
        text = None if colour is None else _text_colour(colour)
        return cls(name=branding.name, colour=colour, text_colour=text)


def _text_colour(colour: str) -> Literal["#000000", "#ffffff"]:
    """Black or white, whichever has the higher contrast: it is never below 4.58 to 1."""
    luminance = _luminance(colour)
    on_black = (luminance + _FLARE) / _FLARE
    on_white = (1 + _FLARE) / (luminance + _FLARE)
    return "#000000" if on_black > on_white else "#ffffff"


def _luminance(colour: str) -> float:
    """How bright a colour is, from 0 for black to 1 for white."""
    shares = (int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5))
    linear = (
        share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares
    )
    return sum(weight * each for weight, each in zip(_WEIGHTS, linear, strict=True))
