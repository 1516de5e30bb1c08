"""frvcpy's own instance as a problem of the planner: one type of charger, and a fixed order.

frvcpy (Froger, Jabali, Mendoza and Laporte 2019; instance tc0c40s8cf0 of Montoya et al. 2017)
inserts charging stops into a fixed route. Its chargers have three speeds and ours have one, so each
route is solved with all chargers of one type. `fixed_routes.json`, beside the tests, holds the
instance's places and frvcpy's results; ``python -m oracles.fixed_routes FILE`` writes it again, in
an environment with the extra `peers`.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

from skyway.drone.model import ChargePoint, DroneModel
from skyway.geo import Position
from skyway.ids import DroneModelId, StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.problem import Problem

#: Routes of frvcpy's test data, and its types of charger.
_ROUTES = ("_0", "_5", "_6", "_13", "_14", "_18", "_23", "_30", "_45", "_60", "_77", "_101")
_CHARGERS = (0, 1, 2)

#: Hours; longer than every result, so that frvcpy's own limit of 10 h cuts off none.
_NO_LIMIT_H = 100.0

_S_PER_H = 3600.0
_SPEED_MPS = 10.0

#: The depot where a route ends. Here it is a destination, so it needs an id of its own.
_END = StationId("end")


def as_problem(instance: dict[str, Any], charger: int, route: list[int]) -> Problem:
    """The route as a problem: its customers are destinations, the depot's double is the last."""
    places = {StationId(str(node)): instance["places"][node] for node in {*route, *_css(instance)}}
    places[_END] = instance["places"][route[-1]]
    chargers = {StationId(str(node)) for node in _css(instance)}
    stations = {
        name: Station(name, Position(x / 1000, y / 1000), 1 if name in chargers else 0)
        for name, (x, y) in places.items()
    }
    m_per_place = _SPEED_MPS * _S_PER_H / instance["places_per_h"]
    segments = tuple(
        Segment(a, b, math.dist(places[a], places[b]) * m_per_place)
        for a in places
        for b in places
        if a != b and places[a] != places[b]
    )
    return Problem.model_validate(
        {
            "network": Network(stations, segments),
            "drone": {"model": _model(instance, charger), "soc": 1.0},
            "source": str(route[0]),
            "packages": [
                {"package_id": name, "mass_kg": 0.0, "destination": name}
                for name in order_of(route)
            ],
            "finish": "stay",
            "dropoff_s": instance["process_h"] * _S_PER_H,
        }
    )


def order_of(route: list[int]) -> tuple[StationId, ...]:
    """The destinations in the order of the route."""
    return (*(StationId(str(node)) for node in route[1:-1]), _END)


def delivery_time_s(instance: dict[str, Any], result: dict[str, Any]) -> float:
    """frvcpy's result as the end of our last delivery, which hands over at the depot too."""
    return float((result["hours"] + instance["process_h"]) * _S_PER_H)


def _css(instance: dict[str, Any]) -> list[int]:
    return list(instance["charging_stations"])


def _model(instance: dict[str, Any], charger: int) -> DroneModel:
    times_h, charges_wh = instance["curves_h"][charger], instance["curve_wh"]
    return DroneModel(
        model_id=DroneModelId("electric-van"),
        empty_mass_kg=1.0,
        max_payload_kg=1.0,
        battery_j=instance["battery_wh"] * _S_PER_H,
        speed_empty_mps=_SPEED_MPS,
        speed_full_mps=_SPEED_MPS,
        power_empty_w=instance["power_w"],
        charge_curve=tuple(
            ChargePoint(time_h * _S_PER_H, charge_wh / instance["battery_wh"])
            for time_h, charge_wh in zip(times_h, charges_wh, strict=True)
        ),
    )


def _main(target: Path) -> None:
    import frvcpy
    import frvcpy.solver

    data = Path(frvcpy.__file__).parent / "test" / "data"
    theirs = json.loads((data / "frvcpy-instance.json").read_text())
    known = json.loads((data / "testdata.json").read_text())
    places = _places(data / "vrprep-instance.xml")
    time_h, energy_wh = (theirs[name][0][1] for name in ("time_matrix", "energy_matrix"))
    written: dict[str, Any] = {
        "source": "frvcpy 0.1.1, instance tc0c40s8cf0; Apache License 2.0",
        "places": places,
        "charging_stations": [one["node_id"] for one in theirs["css"]],
        "process_h": theirs["process_times"][1],
        "battery_wh": theirs["max_q"],
        "curve_wh": theirs["breakpoints_by_type"][0]["charge"],
        "curves_h": [one["time"] for one in theirs["breakpoints_by_type"]],
        "places_per_h": round(math.dist(*places[:2]) / time_h, 6),
        "power_w": round(energy_wh / time_h, 6),
        "results": [],
    }
    for charger in _CHARGERS:
        theirs["t_max"] = _NO_LIMIT_H
        theirs["css"] = [{**one, "cs_type": charger} for one in theirs["css"]]
        for name in (f"route_tc0c40s8cf0{ending}" for ending in _ROUTES):
            route = known[name]["route"]
            hours, _ = frvcpy.solver.Solver(theirs, route, theirs["max_q"]).solve()
            result = {"charger": charger, "route": route, "hours": hours}
            written["results"].append(result)
    lines = (f"{json.dumps(key)}: {json.dumps(value)}" for key, value in written.items())
    target.write_text("{" + ",\n".join(lines) + "}\n")


def _places(path: Path) -> list[list[float]]:
    from xml.etree import ElementTree

    nodes = ElementTree.parse(path).getroot().iter("node")
    by_id = {
        int(node.attrib["id"]): [float(node.findtext("cx") or 0), float(node.findtext("cy") or 0)]
        for node in nodes
    }
    # The depot charges too; frvcpy has it as its last station.
    return [*(by_id[number] for number in range(len(by_id))), by_id[0]]


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
