"""A network of four stations in a line. One charge does not last from end to end."""

from typing import Any


def corridor(name: str) -> dict[str, Any]:
    """Stations name-s1 to name-s4, 11.6 km apart. Drones must recharge on the way."""
    ids = {number: f"{name}-s{number}" for number in range(1, 5)}
    places = {number: [-98.0 + 0.12 * number, 29.5] for number in ids}
    stations = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": places[number]},
            "properties": {"kind": "station", "station_id": station_id, "pads": 2},
        }
        for number, station_id in ids.items()
    ]
    segments = [
        {
            "type": "Feature",
            "geometry": {
                "type": "LineString",
                "coordinates": [places[number], places[number + 1]],
            },
            "properties": {"kind": "segment", "from": ids[number], "to": ids[number + 1]},
        }
        for number in range(1, 4)
    ]
    settings = {"currency": "USD", "loading_s": 60, "dropoff_s": 30}
    return {"type": "FeatureCollection", "settings": settings, "features": stations + segments}
