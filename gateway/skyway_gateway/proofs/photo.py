"""Checks the photo of a hand-over, and makes another of it that holds nothing but the picture."""

from io import BytesIO
from typing import Final

from skyway.errors import InvalidInput

#: The most bytes of an upload, and the most pixels of a side.
MOST_BYTES: Final = 2 * 1024 * 1024
MOST_PIXELS: Final = 4_096

#: The types of uploads, by the names that Pillow has for them.
MEDIA_TYPES: Final = {"image/jpeg": "JPEG", "image/png": "PNG", "image/webp": "WEBP"}

_QUALITY: Final = 85

_TOO_LARGE: Final = f"must have at most {MOST_PIXELS} by {MOST_PIXELS} pixels"


def cleaned(raw: bytes) -> bytes:
    """The photo as a JPEG without metadata, upright; blocks for up to a second.

    Raises
    ------
    InvalidInput
        It is no JPEG, PNG or WebP, is broken, or has too many pixels.
    """
    # Imported here: most gateways get no photos.
    from PIL import Image, ImageOps

    # What Pillow raises for broken pictures.
    broken = (OSError, SyntaxError, ValueError, EOFError, Image.DecompressionBombError)
    try:
        # Only its size and form are read yet.
        picture = Image.open(BytesIO(raw), formats=[*MEDIA_TYPES.values()])
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise InvalidInput("body", f"the photo {_TOO_LARGE}") from error
    except broken as error:
        raise InvalidInput("body", "is no photo: it must be a JPEG, PNG or WebP") from error
    width, height = picture.size
    if max(width, height) > MOST_PIXELS:
        raise InvalidInput("body", f"the photo {_TOO_LARGE}; it has {width} by {height}")
    made = BytesIO()
    try:
        upright = ImageOps.exif_transpose(picture).convert("RGB")
        # A new picture has no metadata, which JPEG would keep.
        upright.info.clear()
        upright.save(made, "JPEG", quality=_QUALITY)
    except broken as error:
        raise InvalidInput("body", "the photo is broken or cut off") from error
    return made.getvalue()
