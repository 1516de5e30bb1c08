"""Tiny random networks as GeoJSON: stations on a lattice, segments of few lengths, box zones."""

from datetime import UTC, datetime, timedelta
from random import Random
from typing import Any

#: Time 0 of every random problem.
START_AT = datetime(2026, 3, 1, 12, tzinfo=UTC)

#: Metres: flown at 8, 12, 16, 20 and 24 m/s in 300, 200, 150, 120 and 100 s.
UNIT_M = 2400.0

#: Degrees between the lines of the lattice on which stations stand.
_LATTICE_DEG = 0.02


def world(rng: Random, count: int, *, is_rough: bool) -> dict[str, Any]:
    """A FeatureCollection of so many stations; a rough one has lengths off the grid."""
    names = [f"s{number}" for number in range(count)]
    places = rng.sample([(x, y) for x in range(4) for y in range(4)], count)
    features = [_station(rng, *named) for named in zip(names, places, strict=True)]
    features += _segments(rng, names, is_rough=is_rough)
    for number in range(rng.choice([0, 0, 0, 1, 1, 2])):
        features.append(_zone(rng, number))
    return {"type": "FeatureCollection", "features": features}


def moment(rng: Random, least_s: int, most_s: int) -> float:
    """A random multiple of 10 s."""
    return 10.0 * rng.randint(least_s // 10, most_s // 10)


def _station(rng: Random, name: str, place: tuple[int, int]) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [_LATTICE_DEG * step for step in place]},
        "properties": {
            "kind": "station",
            "station_id": name,
            "pads": rng.choice([0, 1, 1, 1, 2, 2, 3]),
        },
    }


def _segments(rng: Random, names: list[str], *, is_rough: bool) -> list[dict[str, Any]]:
    pairs = [(rng.choice(names[:number]), names[number]) for number in range(1, len(names))]
    others = [(a, b) for a in names for b in names if a < b and (a, b) not in pairs]
    pairs += rng.sample(others, min(len(others), rng.randint(0, len(names))))
    segments = []
    for pair in pairs:
        start, end = rng.sample(pair, 2)
        length_m = UNIT_M * rng.choice([1, 1, 1, 2, 2, 3])
        if is_rough:
            length_m = round(length_m * rng.uniform(0.7, 1.3), 1)
        properties = {"kind": "segment", "from": start, "to": end, "length_m": length_m}
        if rng.random() < 0.12:
            properties["one_way"] = True
        segments.append(
            {
                "type": "Feature",
                # The reader takes the ends from the stations that it names.
                "geometry": {"type": "LineString", "coordinates": [start, end]},
                "properties": properties,
            }
        )
    return segments


def place_segments(collection: dict[str, Any]) -> dict[str, Any]:
    """The same collection with the positions of stations as the ends of segments."""
    positions = {
        feature["properties"]["station_id"]: feature["geometry"]["coordinates"]
        for feature in collection["features"]
        if feature["properties"]["kind"] == "station"
    }
    for feature in collection["features"]:
        if feature["properties"]["kind"] == "segment":
            ends = (feature["properties"][end] for end in ("from", "to"))
            feature["geometry"]["coordinates"] = [positions[end] for end in ends]
    return collection


def _zone(rng: Random, number: int) -> dict[str, Any]:
    """A box whose sides run between the lines of the lattice, seldom on one; mostly with dates."""
    shift = rng.choice([0.25, 0.5, 0.5, 0.75, 0.0])
    west, south = (_LATTICE_DEG * (rng.randint(-1, 2) + shift) for _ in range(2))
    width, height = (_LATTICE_DEG * rng.choice([0.3, 0.5, 1.0]) for _ in range(2))
    east, north = west + width, south + height
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    properties: dict[str, Any] = {"kind": "zone", "zone_id": f"z{number}"}
    start_s = moment(rng, -200, 1500)
    if rng.random() < 0.9:
        properties["active_from"] = _dated(start_s)
    if rng.random() < 0.85:
        properties["active_until"] = _dated(start_s + moment(rng, 50, 800))
    return {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": properties,
    }


def _dated(at_s: float) -> str:
    return (START_AT + timedelta(seconds=at_s)).isoformat()
