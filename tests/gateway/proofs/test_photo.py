"""What is left of a photo: the picture, upright, and nothing else."""

from io import BytesIO

import pytest
from PIL import Image
from skyway_gateway.proofs.photo import cleaned

from skyway.errors import InvalidInput

#: The tags of EXIF for the text of a picture and for its turn.
_DESCRIPTION, _ORIENTATION = 0x010E, 0x0112


def test_a_photo_loses_its_metadata_and_stands_upright() -> None:
    picture = Image.new("RGB", (60, 20), "navy")
    exif = Image.Exif()
    exif[_DESCRIPTION], exif[_ORIENTATION] = "taken at home", 6
    raw = BytesIO()
    picture.save(raw, "JPEG", exif=exif, comment=b"a comment")

    made = cleaned(raw.getvalue())

    shown = Image.open(BytesIO(made))
    assert (shown.format, shown.size) == ("JPEG", (20, 60))
    assert not shown.getexif()
    assert b"home" not in made
    assert b"comment" not in made


def test_a_photo_with_transparency_becomes_a_jpeg() -> None:
    raw = BytesIO()
    Image.new("RGBA", (8, 8)).save(raw, "PNG")

    assert cleaned(raw.getvalue())[:2] == b"\xff\xd8"


@pytest.mark.parametrize("size", [(4_097, 8), (12_000, 12_000)])
def test_the_limit_of_pixels_is_named(size: tuple[int, int]) -> None:
    raw = BytesIO()
    Image.new("1", size).save(raw, "PNG")

    with pytest.raises(InvalidInput, match="at most 4096 by 4096 pixels"):
        cleaned(raw.getvalue())
