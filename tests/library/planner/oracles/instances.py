"""Tiny random problems that mix every feature of docs/reference/planner-problem.md, by seed.

Three in four are smooth: every flight, stop, window and closure lasts a multiple of 10 s with any
load. So the grid programme is late by less than one tick, because a recharge may end between two
ticks. The others are rough: any float. Batteries hold one to four segments.
"""

from collections.abc import Sequence
from random import Random
from typing import Any

from skyway.planner.problem import Problem
from tests.library.planner.oracles.worlds import START_AT, UNIT_M, moment, place_segments, world

#: Metres per second empty and full, with loads of whole kilograms of 4; see `worlds.UNIT_M`.
_SPEEDS = ((24.0, 8.0), (24.0, 8.0), (20.0, 20.0), (8.0, 24.0), (24.0, 24.0))
_STATIONS = (2, 3, 3, 4, 4, 5, 5, 6, 7)
_OPEN_STATIONS = (4, 5, 6, 7, 8, 9, 10)
_MAX_PAYLOAD_KG = 4
_POWER_W = 100.0


def make_problem(seed: int, **fields: Any) -> Problem:
    """The problem of this seed; `fields` replace those of the JSON form."""
    return Problem.model_validate({**as_json(seed), **fields})


def make_open_problem(seed: int, **fields: Any) -> Problem:
    """A problem of up to 10 stations without closures and zones, for the mixed-integer model."""
    made = as_json(seed, stations=_OPEN_STATIONS)
    network = made["network"]
    kept = [one for one in network["features"] if one["properties"]["kind"] != "zone"]
    open_sky = {"network": {**network, "features": kept}, "closures": []}
    return Problem.model_validate({**made, **open_sky, **fields})


def make_stormy_problem(seed: int, **fields: Any) -> Problem:
    """A problem in which half of all stations and segments close at times."""
    return Problem.model_validate({**as_json(seed, closed_share=0.5), **fields})


def make_busy_problem(seed: int, **fields: Any) -> Problem:
    """A problem that starts low, on pads taken again and again: sessions have to be split."""
    rng = Random(f"busy {seed}")
    made = as_json(seed)
    drone, reserve = made["drone"], made["drone"]["model"]["reserve_soc"]
    low = round(rng.uniform(reserve, min(1.0, reserve + 0.4)), 3)
    taken = [
        {"station_id": one["properties"]["station_id"], "pad": pad, **times}
        for one in made["network"]["features"]
        if one["properties"]["kind"] == "station"
        for pad in range(one["properties"]["pads"])
        for times in _train(rng)
    ]
    busy = {"drone": {**drone, "soc": max(low, reserve)}, "pad_reservations": taken}
    return Problem.model_validate({**made, **busy, **fields})


def make_windowed_problem(seed: int, **fields: Any) -> Problem:
    """A problem with windows of hand-overs and of the pickup; some cannot be met."""
    rng = Random(f"windows {seed}")
    made = as_json(seed)
    dropoff_s, loading_s = made["dropoff_s"], made["loading_s"]
    by_station = {one["destination"]: _window(rng, dropoff_s) for one in made["packages"]}
    packages = [{**one, **by_station[one["destination"]]} for one in made["packages"]]
    pickup = {f"pickup_{name}": limit for name, limit in _window(rng, loading_s).items()}
    return Problem.model_validate({**made, "packages": packages, **pickup, **fields})


def make_windy_problem(seed: int, **fields: Any) -> Problem:
    """A problem with weather in one to three periods, some of which close segments."""
    made = as_json(seed)
    return Problem.model_validate({**made, "weather": weather_of(seed, made), **fields})


def weather_of(seed: int, made: dict[str, Any]) -> dict[str, Any]:
    """Weather for this problem; its factors keep flights at multiples of 5 s."""
    rng = Random(f"weather {seed}")
    ends = [
        pair
        for one in made["network"]["features"]
        if (properties := one["properties"])["kind"] == "segment"
        for pair in _both_ways(properties)
    ]
    segments = rng.sample(ends, rng.randint(1, len(ends)))
    choices: tuple[list[float | None], ...] = (
        [0.5, 1.0, 1.5, 2.0],
        [1.5, 2.0, 3.0],
        [0.5, 0.5, 1.0],
        [1.0, 2.0, None],
    )
    likely = rng.choice(choices)
    periods: list[dict[str, Any]] = []
    at_s = moment(rng, -200, 600)
    for _ in range(rng.randint(1, 3)):
        end_s = max(at_s, 0.0) + moment(rng, 100, 900)
        period: dict[str, Any] = {"start_s": at_s, "end_s": end_s}
        period["time_factors"] = [rng.choice(likely) for _ in segments]
        if rng.random() < 0.5:
            period["energy_factors"] = [rng.choice([0.8, 1.0, 1.3]) for _ in segments]
        periods.append(period)
        at_s = end_s
    if rng.random() < 0.3:
        periods[-1]["end_s"] = None
    return {"segments": segments, "periods": periods}


def _both_ways(properties: dict[str, Any]) -> list[list[str]]:
    there = [properties["from"], properties["to"]]
    return [there] if properties.get("one_way") else [there, there[::-1]]


def make_problem_with_powers(seed: int, **fields: Any) -> Problem:
    """A problem on stations whose pads give different powers; many start with little charge."""
    rng = Random(f"low {seed}")
    made = as_json(seed)
    drone = made["drone"]
    if rng.random() < 0.5:
        drone = {**drone, "soc": max(drone["model"]["reserve_soc"], round(rng.random() * 0.4, 3))}
    return Problem.model_validate({**with_powers(seed, {**made, "drone": drone}), **fields})


def with_powers(seed: int, made: dict[str, Any]) -> dict[str, Any]:
    """The problem with power limits of many stations: of each pad, or shared by the pads."""
    rng = Random(f"powers {seed}")
    model = made["drone"]["model"]
    (from_s, low), (until_s, high) = model["charge_curve"][:2]
    fastest_w = model["battery_j"] * (high - low) / (until_s - from_s)
    features = []
    for feature in made["network"]["features"]:
        properties = dict(feature["properties"])
        if properties["kind"] == "station" and properties["pads"] and rng.random() < 0.75:
            power_w = max(10.0, round(fastest_w * rng.choice([0.2, 0.4, 0.7, 1.2]), 2))
            if rng.random() < 0.6:
                properties["pad_power_w"] = power_w
            else:
                properties["station_power_w"] = power_w * properties["pads"]
        features.append({**feature, "properties": properties})
    return {**made, "network": {**made["network"], "features": features}}


def make_problem_with_connectors(seed: int, **fields: Any) -> Problem:
    """A busy problem on stations whose pads fit some drones only, for a drone with a connector."""
    made = make_busy_problem(seed).model_dump(mode="json")
    return Problem.model_validate({**with_connectors(seed, made), **fields})


def with_connectors(seed: int, made: dict[str, Any]) -> dict[str, Any]:
    """The problem with connectors of many stations, for a drone with the connector "own"."""
    rng = Random(f"connectors {seed}")
    features = []
    for feature in made["network"]["features"]:
        properties = dict(feature["properties"])
        if properties["kind"] == "station" and properties["pads"] and rng.random() < 0.75:
            properties["pad_connectors"] = rng.choice([["own"], ["other"], ["other", "own"]])
        features.append({**feature, "properties": properties})
    model = {**made["drone"]["model"], "connector": "own"}
    network = {**made["network"], "features": features}
    return {**made, "network": network, "drone": {**made["drone"], "model": model}}


def make_problem_with_hours(seed: int, **fields: Any) -> Problem:
    """A problem with opening hours of half of its stations, and some windows."""
    rng = Random(f"hours {seed}")
    made = as_json(seed)
    for feature in made["network"]["features"]:
        if feature["properties"]["kind"] == "station" and rng.random() < 0.5:
            feature["properties"]["opening_hours"] = {"weekly": {"sun": _spans(rng)}}
    packages = [
        {**one, "not_before_s": moment(rng, 0, 2000)} if rng.random() < 0.2 else one
        for one in made["packages"]
    ]
    return Problem.model_validate({**made, "packages": packages, **fields})


def _spans(rng: Random) -> list[str]:
    """Opening hours around noon, when every random problem starts."""
    spans = []
    minute = 12 * 60 + rng.randint(-30, 20)
    for _ in range(rng.randint(1, 3)):
        end = minute + rng.randint(2, 40)
        spans.append(f"{minute // 60:02}:{minute % 60:02}-{end // 60:02}:{end % 60:02}")
        minute = end + rng.randint(1, 25)
    return spans


def _window(rng: Random, takes_s: float) -> dict[str, float]:
    """A window, with both ends, one or none, in multiples of 10 s."""
    window = {}
    if rng.random() < 0.45:
        window["not_before_s"] = moment(rng, -100, 2500)
    if rng.random() < 0.35:
        least_s = window.get("not_before_s", 0.0) + takes_s
        window["latest_s"] = least_s + moment(rng, 0, 2500)
    return window


def _train(rng: Random) -> list[dict[str, float]]:
    """One reservation after another, with short gaps between."""
    times = []
    at_s = moment(rng, -200, 200)
    for _ in range(rng.randint(3, 10)):
        end_s = at_s + moment(rng, 20, 300)
        times.append({"start_s": at_s, "end_s": end_s})
        at_s = end_s + moment(rng, 10, 150)
    return times


def as_json(
    seed: int, *, stations: Sequence[int] = _STATIONS, closed_share: float = 0.12
) -> dict[str, Any]:
    """The problem of this seed in its JSON form."""
    rng = Random(f"skyway {seed}")
    is_rough = rng.random() < 0.25
    network = world(rng, rng.choice(stations), is_rough=is_rough)
    names = _station_names(network)
    source = rng.choice(names)
    packages = _packages(rng, [name for name in names if name != source], source, is_rough)
    start = rng.choice(names) if rng.random() < 0.3 else None
    load_kg = min(sum(package["mass_kg"] for package in packages), _MAX_PAYLOAD_KG)
    model = _model(rng, load_kg=load_kg, is_rough=is_rough)
    reserve = model["reserve_soc"]
    soc = 1.0 if rng.random() < 0.4 else round(rng.uniform(reserve, 1.0), 2)
    return {
        "start_at": START_AT.isoformat(),
        "drone": {"model": model, "soc": max(soc, reserve), "station_id": start},
        "source": source,
        "packages": packages,
        "pad_reservations": _reservations(rng, network, is_rough=is_rough),
        "closures": _closures(rng, network, closed_share),
        "recharge_policy": rng.choice(["partial", "partial", "partial", "full"]),
        "finish": rng.choice(["recharge", "stay"]),
        "loading_s": rng.choice([0.0, 0.0, 10.0, 60.0]),
        "dropoff_s": rng.choice([0.0, 0.0, 10.0, 30.0]),
        "latest_delivery_s": 1005.0 + moment(rng, 0, 3000) if rng.random() < 0.15 else None,
        "network": place_segments(network),
    }


def _station_names(network: dict[str, Any]) -> list[str]:
    properties = [feature["properties"] for feature in network["features"]]
    return [one["station_id"] for one in properties if one["kind"] == "station"]


def _packages(rng: Random, others: list[str], source: str, is_rough: bool) -> list[dict[str, Any]]:
    requested = rng.sample(others, min(len(others), rng.choice([1, 1, 2, 2, 3, 4])))
    if rng.random() < 0.1:
        requested.append(source)
    if rng.random() < 0.3:
        requested.append(rng.choice(requested))
    rng.shuffle(requested)
    left_kg: float = _MAX_PAYLOAD_KG if rng.random() < 0.97 else _MAX_PAYLOAD_KG + 2
    packages = []
    for number, destination in enumerate(requested):
        mass_kg: float = rng.choice([0, 1, 1, 2])
        if is_rough:
            mass_kg = round(mass_kg * rng.uniform(0.5, 1.0), 3)
        mass_kg = min(mass_kg, left_kg)
        left_kg -= mass_kg
        packages.append(
            {"package_id": f"p{number}", "mass_kg": mass_kg, "destination": destination}
        )
    return packages


def _model(rng: Random, *, load_kg: float, is_rough: bool) -> dict[str, Any]:
    speed_empty_mps, speed_full_mps = rng.choice(_SPEEDS)
    if is_rough:
        speed_empty_mps, speed_full_mps = (rng.uniform(9, 24) for _ in range(2))
    curve = _charge_curve(rng)
    reserve = rng.choice([curve[0][1], curve[0][1], 0.1, 0.2])
    reserve = max(reserve, curve[0][1])
    empty_kg = rng.choice([4.0, 12.0, 40.0])
    speed_mps = speed_empty_mps + (speed_full_mps - speed_empty_mps) * load_kg / _MAX_PAYLOAD_KG
    segment_j = _POWER_W * ((empty_kg + load_kg) / empty_kg) ** 1.5 * UNIT_M / speed_mps
    segments = rng.choice([2.0, 3.0, 3.0, 3.5, 4.0, 6.0, rng.uniform(2.0, 8.0)])
    battery_j = segments * segment_j / (curve[-1][1] - reserve)
    return {
        "model_id": "tiny",
        "empty_mass_kg": empty_kg,
        "max_payload_kg": _MAX_PAYLOAD_KG,
        "battery_j": battery_j,
        "reserve_soc": reserve,
        "speed_empty_mps": speed_empty_mps,
        "speed_full_mps": speed_full_mps,
        "power_empty_w": _POWER_W,
        "stop_s": rng.choice([0.0, 0.0, 10.0, 20.0]),
        "stop_j": rng.choice([0.0, 0.0, 0.05, 0.1]) * segment_j,
        "charge_curve": curve,
    }


def _charge_curve(rng: Random) -> list[tuple[float, float]]:
    """Two to five points, each piece slower than the one before."""
    pieces = rng.randint(1, 4)
    first = rng.choice([0.0, 0.0, 0.05])
    top = rng.choice([1.0, 1.0, 0.9, 0.8])
    at_s = rng.choice([0.0, 0.0, 40.0])
    points = [(at_s, first)]
    rises = [rng.uniform(0.5, 1.5) for _ in range(pieces)]
    slowness_s = rng.choice([200.0, 500.0, 1000.0])
    soc = first
    for number, rise in enumerate(rises):
        step = (top - first) * rise / sum(rises)
        soc = top if number == pieces - 1 else round(soc + step, 3)
        rise_soc = soc - points[-1][1]
        at_s += round(slowness_s * rise_soc, 1) or 1.0
        slowness_s *= rng.choice([1.3, 2.0, 4.0])
        points.append((at_s, soc))
    return points


def _reservations(rng: Random, network: dict[str, Any], *, is_rough: bool) -> list[dict[str, Any]]:
    """Pads taken now and then, some for good, some one after another on different pads."""
    taken = []
    share = rng.choice([0.0, 0.5, 0.9])
    for feature in network["features"]:
        if feature["properties"]["kind"] != "station":
            continue
        station_id = feature["properties"]["station_id"]
        at_s = moment(rng, -300, 300)
        for pad in range(feature["properties"]["pads"]):
            if rng.random() >= share:
                continue
            if rng.random() < 0.5:
                at_s = moment(rng, -300, 300)
            for _ in range(rng.choice([1, 2, 2, 3])):
                end_s: float | None = at_s + moment(rng, 20, 700)
                if rng.random() < 0.1:
                    end_s = None
                shift_s = round(rng.uniform(0, 9.9), 4) if is_rough else 0.0
                start_s = at_s + shift_s
                taken.append(
                    {"station_id": station_id, "pad": pad, "start_s": start_s, "end_s": end_s}
                )
                if end_s is None:
                    break
                at_s = end_s + 10.0 * rng.choice([0 if shift_s == 0 else 1, 2, 10, 30])
    return taken


def _closures(rng: Random, network: dict[str, Any], share: float) -> list[dict[str, Any]]:
    closures: list[dict[str, Any]] = []
    for feature in network["features"]:
        properties = feature["properties"]
        if properties["kind"] == "zone" or rng.random() >= share:
            continue
        what = (
            {"station_id": properties["station_id"]}
            if properties["kind"] == "station"
            else {"from": properties["from"], "to": properties["to"]}
        )
        start_s = moment(rng, -100, 1500)
        end_s = None if rng.random() < 0.15 else start_s + moment(rng, 20, 900)
        closures.append({**what, "start_s": start_s, "end_s": end_s})
    return closures
