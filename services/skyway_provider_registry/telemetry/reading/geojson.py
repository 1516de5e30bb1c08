"""Telemetry for maps: a FeatureCollection of points with their times, as QGIS and kepler take it.

Points rather than one line: both tools colour, filter and play points by an attribute and a time.
"""

from typing import Any, Final

from skyway.contracts.message import utc_text
from skyway.ids import DroneId
from skyway.runtime.http.paging import Page
from skyway_provider_registry.telemetry.reading.measured import Measured

GEOJSON: Final = "application/geo+json"

_BESIDE: Final = {"at", "position", "spread"}


def feature_collection(drone_id: DroneId, page: Page[Measured]) -> dict[str, Any]:
    """A page as GeoJSON (RFC 7946); `next_cursor` is a foreign member. Any: a JSON document."""
    return {
        "type": "FeatureCollection",
        "features": [_feature(drone_id, item) for item in page.items],
        "next_cursor": page.next_cursor,
    }


def _feature(drone_id: DroneId, item: Measured) -> dict[str, Any]:
    """One point; what a minute spreads over stands beside its means, since tools read no objects.

    Any: a JSON document.
    """
    properties = {"drone_id": drone_id, "at": utc_text(item.at)}
    properties |= item.model_dump(exclude=_BESIDE, exclude_none=True)
    if item.spread is not None:
        properties |= item.spread.model_dump()
    point = {"type": "Point", "coordinates": list(item.position)}
    return {"type": "Feature", "geometry": point, "properties": properties}
