"""The stations of a hot world, and the drones that fly there."""

from typing import Any

from skyway.drone.models import DRONE_MODELS
from skyway.geo import Position
from skyway.ids import DroneModelId

#: Three stations, 12 km from each other, with a pad each.
PLACES = {"a": Position(0.0, 0.0), "b": Position(0.1079, 0.0), "c": Position(0.05395, 0.0934)}

#: Flies two of the three legs with one charge, and lands with something to lose.
MODEL = DRONE_MODELS[DroneModelId("paper-scenario")].model_copy(
    update={"reserve_soc": 0.05, "stop_s": 30.0, "stop_j": 4_000.0}
)


def network() -> dict[str, Any]:
    """Every station connected with every other one, by segments both ways."""
    points = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": list(position)},
            "properties": {"kind": "station", "station_id": name, "pads": 1},
        }
        for name, position in PLACES.items()
    ]
    lines = [
        {
            "type": "Feature",
            "geometry": {
                "type": "LineString",
                "coordinates": [list(PLACES[start]), list(PLACES[end])],
            },
            "properties": {"kind": "segment", "from": start, "to": end},
        }
        for start, end in ("ab", "bc", "ca")
    ]
    return {"type": "FeatureCollection", "features": points + lines}
