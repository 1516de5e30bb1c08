"""The places of the bundled extract of GeoNames: their names, and where they are."""

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from skyway.geo import Position


@cache
def bundled_extract() -> Mapping[str, Any]:
    """The file of the bundled places and airports, as `data/ATTRIBUTION.md` describes it."""
    source = files("skyway.network").joinpath("data", "texas_corridor.json")
    extract: Mapping[str, Any] = json.loads(source.read_text(encoding="utf-8"))
    return extract


def bundled_places() -> list[tuple[str, Position]]:
    """Each bundled place by its name."""
    return [
        (place["name"], Position(place["longitude_deg"], place["latitude_deg"]))
        for place in bundled_extract()["places"]
    ]
