"""A network of ladders: two parallel rails of stations, so that there is always a second route."""

from typing import Any

from skyway.drone.models import PAPER_SCENARIO

#: Charges in ten minutes, so that a story ends within a minute at 60 times the wall clock.
QUICK_CHARGE: dict[str, Any] = PAPER_SCENARIO.model_dump(mode="json") | {
    "model_id": "quick-charge",
    "charge_curve": [[0.0, 0.0], [600.0, 1.0]],
}

#: Stations of a rail.
_LENGTH = 5


def ladders(*names: str, step_deg: float = 0.12) -> dict[str, Any]:
    """A ladder for each name. Ladder `a` has the rails a-s1 to a-s5 and a-t1 to a-t5.

    The stations of a rail are `step_deg` of longitude apart, 0.12 are 11.6 km. The rails are
    3.3 km apart, the ladders 110 km.
    """
    features: list[dict[str, Any]] = []
    for number, name in enumerate(names):
        places = {
            f"{name}-{rail}{rung}": [-98.0 + step_deg * rung, 29.5 + number + offset]
            for rail, offset in (("s", 0.0), ("t", 0.03))
            for rung in range(1, _LENGTH + 1)
        }
        features += [_station(station_id, place) for station_id, place in places.items()]
        features += [
            _segment(f"{name}-{rail}{rung}", f"{name}-{rail}{rung + 1}", places)
            for rail in ("s", "t")
            for rung in range(1, _LENGTH)
        ]
        features += [
            _segment(f"{name}-s{rung}", f"{name}-t{rung}", places) for rung in range(1, _LENGTH + 1)
        ]
    settings = {"currency": "USD", "loading_s": 30, "dropoff_s": 30}
    return {"type": "FeatureCollection", "settings": settings, "features": features}


def _station(station_id: str, place: list[float]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": place},
        "properties": {"kind": "station", "station_id": station_id, "pads": 2},
    }


def _segment(start: str, end: str, places: dict[str, list[float]]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": [places[start], places[end]]},
        "properties": {"kind": "segment", "from": start, "to": end},
    }
