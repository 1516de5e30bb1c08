"""A published instance with few chargers, read from the file in frvcpy's package.

It is one of the 120 instances of the electric vehicle routing problem with nonlinear charging
(Montoya et al. 2017): 40 customers, 8 charging stations, one depot. Froger et al. (2022) solve it
with stations that charge few vehicles at a time; here each station has one pad.

Places, distances, the battery, its consumption and its charge curve are those of the file. Two
things differ. The file has three speeds of charging; here all stations charge at the middle one.
Its goal is a short total time of routes that end at the depot; ours is an early mean delivery, and
the vehicles return to the depot only to load.
"""

import math
from importlib.resources import files
from itertools import combinations
from typing import Any, Final
from xml.etree import ElementTree

from skyway.dispatch.problem import FleetProblem
from skyway.drone.model import DroneModel

_FILE: Final = "vrprep-instance.xml"

#: The vehicles. Our own choice: the file does not limit them.
_VEHICLES: Final = 10

#: Metres of a degree of a great circle; only straight lines of the file count as distances.
_M_PER_DEGREE: Final = 111_195.0


def published_fleet(*, pooling: bool) -> FleetProblem:
    """All customers of the instance as requests that come from the depot."""
    text = files("frvcpy").joinpath("test", "data", _FILE).read_text(encoding="utf-8")
    instance = ElementTree.fromstring(text)
    nodes = instance.findall("./network/nodes/node")
    depot = next(_name(each) for each in nodes if each.get("type") == "0")
    customers = [_name(each) for each in nodes if each.get("type") == "1"]
    service_s = 3600 * _number(instance, "./requests/request/service_time")
    model = _model(instance)
    return FleetProblem.model_validate(
        {
            "network": {"type": "FeatureCollection", "features": _features(nodes)},
            "drones": [
                {"drone_id": f"d{each}", "model": model, "station_id": depot, "soc": 1.0}
                for each in range(_VEHICLES)
            ],
            "requests": [
                {
                    "request_id": each,
                    "source": depot,
                    "packages": [{"package_id": each, "mass_kg": 0.0, "destination": each}],
                    "pooling": pooling,
                }
                for each in customers
            ],
            "dropoff_s": service_s,
            "most_pooled": 4,
            "prices": {"lateness": 0.0},
        }
    )


def _model(instance: ElementTree.Element) -> DroneModel:
    profile = "./fleet/vehicle_profile/"
    speed_mps = _number(instance, f"{profile}speed_factor") / 3.6
    j_per_m = _number(instance, f"{profile}custom/consumption_rate") * 3.6
    battery_wh = _number(instance, f"{profile}custom/battery_capacity")
    curve = instance.findall(f"{profile}custom/charging_functions/function[@cs_type='normal']/*")
    return DroneModel.model_validate(
        {
            "model_id": "montoya-2017",
            "empty_mass_kg": 1_000.0,
            "max_payload_kg": 1.0,
            "battery_j": battery_wh * 3600,
            "speed_empty_mps": speed_mps,
            "speed_full_mps": speed_mps,
            "power_empty_w": j_per_m * speed_mps,
            "charge_curve": [
                (
                    3600 * _number(each, "charging_time"),
                    _number(each, "battery_level") / battery_wh,
                )
                for each in curve
            ],
        }
    )


def _features(nodes: list[ElementTree.Element]) -> list[dict[str, Any]]:  # GeoJSON
    at_km = {_name(each): (_number(each, "cx"), _number(each, "cy")) for each in nodes}
    at_deg = {
        name: [1000 * x / _M_PER_DEGREE, 1000 * y / _M_PER_DEGREE] for name, (x, y) in at_km.items()
    }
    stations = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": at_deg[_name(each)]},
            "properties": {
                "kind": "station",
                "station_id": _name(each),
                "pads": 1 if each.get("type") == "2" else 0,
            },
        }
        for each in nodes
    ]
    segments = [
        {
            "type": "Feature",
            "geometry": {"type": "LineString", "coordinates": [at_deg[one], at_deg[other]]},
            "properties": {
                "kind": "segment",
                "from": one,
                "to": other,
                "length_m": 1000 * math.dist(at_km[one], at_km[other]),
            },
        }
        for one, other in combinations(at_km, 2)
    ]
    return stations + segments


def _name(node: ElementTree.Element) -> str:
    return f"node-{node.get('id')}"


def _number(element: ElementTree.Element, path: str) -> float:
    return float(element.findtext(path) or "nan")
