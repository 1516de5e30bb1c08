"""Each view looks as in docs/pictures. Small differences of how a machine draws are allowed."""

from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image, ImageChops, ImageFilter
from playwright.sync_api import Browser

from tests.end_to_end.browser import needs_browser, opened_browser
from tests.pictures.__main__ import PICTURES
from tests.pictures.recorded_world import recorded_world
from tests.pictures.taken import picture_of
from tests.pictures.views import SCREENS, VIEWS

pytestmark = [pytest.mark.integration, pytest.mark.long, needs_browser]

#: Pixels that differ by less in each colour are equal: edges of letters, and colours of a palette.
SAME = 40
#: The largest share of pixels that may differ.
MOST_DIFFERENT = 0.01
#: The side of the squares whose mean colours are compared, pixels; by how much these may differ;
#: and the largest share of squares that may differ more. The base map is as faint as that.
SQUARE = 16
SAME_MEAN = 4
MOST_SQUARES = 0.02
#: On a busy machine a map may say that it is drawn before all of it is.
MOST_TAKEN = 3


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with opened_browser() as opened:
        yield opened


def difference(one: Image.Image, other: Image.Image) -> float:
    """The share of pixels that differ, after edges were blurred."""
    if one.size != other.size:
        return 1.0
    blurred = [each.convert("RGB").filter(ImageFilter.GaussianBlur(2)) for each in (one, other)]
    most = ImageChops.difference(*blurred).convert("L").point(lambda level: 255 * (level > SAME))
    return most.histogram()[255] / (one.width * one.height)


def faint_difference(one: Image.Image, other: Image.Image) -> float:
    """The share of squares whose mean colours differ, in the colour that differs most."""
    size = (one.width // SQUARE, one.height // SQUARE)
    means = [each.convert("RGB").resize(size, Image.Resampling.BOX) for each in (one, other)]
    red, green, blue = ImageChops.difference(*means).split()
    most = ImageChops.lighter(ImageChops.lighter(red, green), blue)
    return sum(most.histogram()[SAME_MEAN + 1 :]) / (size[0] * size[1])


def look_the_same(one: Image.Image, other: Image.Image) -> bool:
    """Whether nobody would see a difference."""
    return difference(one, other) <= MOST_DIFFERENT and faint_difference(one, other) <= MOST_SQUARES


@pytest.mark.parametrize("name", SCREENS)
@pytest.mark.parametrize("view", VIEWS)
def test_a_view_looks_as_in_its_picture(browser: Browser, view: str, name: str) -> None:
    with Image.open(PICTURES / f"{view}-{name}.png") as committed:

        def looks_the_same() -> bool:
            taken = picture_of(browser, recorded_world(), view, SCREENS[name])
            return look_the_same(committed, taken)

        assert any(looks_the_same() for _ in range(MOST_TAKEN))


def test_a_button_that_is_gone_is_seen() -> None:
    with Image.open(PICTURES / "delivery-phone.png") as committed:
        changed = committed.convert("RGB")
    changed.paste((128, 128, 128), (20, 300, 180, 344))

    with Image.open(PICTURES / "delivery-phone.png") as committed:
        assert difference(committed, changed) > MOST_DIFFERENT


def test_a_base_map_that_is_gone_is_seen() -> None:
    with Image.open(PICTURES / "new-delivery-light.png") as picture:
        committed = picture.convert("RGB")
    # The land turns to the colour of the page around the map.
    pixels = np.array(committed)
    land, page = pixels[650, 560], pixels[850, 30]
    pixels[(pixels == land).all(axis=2)] = page
    changed = Image.fromarray(pixels)

    assert difference(committed, changed) <= MOST_DIFFERENT
    assert not look_the_same(committed, changed)
