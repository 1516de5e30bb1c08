"""Answers in GeoJSON (RFC 7946)."""

from typing import Final

from fastapi.responses import JSONResponse

GEOJSON: Final = "application/geo+json"


class GeoJsonResponse(JSONResponse):
    """An answer in GeoJSON."""

    media_type = GEOJSON
