"""Problems whose every limit touches a plan, so that only this plan's own moments are left.

Segments, stations and pads are closed or reserved until the very moment at which the best plan
begins to use them, and again from the very moment at which it ends. Each limit only takes away
other plans. So the best plan must stay the best, with the same time: an oracle that shares no
arithmetic with the search.
"""

import math
from collections import defaultdict
from collections.abc import Iterator
from datetime import timedelta
from itertools import zip_longest
from random import Random
from typing import Any

from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, Recharge
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from tests.library.planner.oracles.instances import as_json, make_windowed_problem, weather_of
from tests.library.planner.oracles.worlds import START_AT

Fields = dict[str, Any]
#: What is used from a moment until another, by station or segment.
_Uses = dict[Any, list[tuple[float, float]]]

_BEFORE_S = -100.0


def problem_to_touch(seed: int) -> Fields:
    """A random problem: with windows or weather or neither, some far in the future."""
    rng = Random(f"touching {seed}")
    kind = rng.choice(["plain", "windy", "windows", "late"])
    if kind in ("plain", "windy"):
        made = as_json(seed)
        return {**made, "weather": weather_of(seed, made)} if kind == "windy" else made
    made = make_windowed_problem(seed).model_dump(mode="json", by_alias=True)
    later_s = rng.choice([0.0, 12_345.6, 1e6 + 0.1, 1e8 / 3]) if kind == "late" else 0.0
    for one in (made, *made["packages"]):
        for name in ("not_before_s", "latest_s", "pickup_not_before_s", "pickup_latest_s"):
            if one.get(name) is not None:
                one[name] += later_s
    if later_s:
        made["latest_delivery_s"] = None
        made["pickup_not_before_s"] = max(later_s, made["pickup_not_before_s"] or 0.0)
    return made


def make_touching_problem(seed: int, **fields: Any) -> Problem:
    """A problem in still air whose limits touch its best plan, if it has a plan."""
    made = {**problem_to_touch(seed), "weather": None, **fields}
    problem = Problem.model_validate(made)
    plan = compose(problem)
    if plan.delivery_time_s is None:
        return problem
    limited = touched(made, plan, Random(seed))
    return Problem.model_validate({**limited, "weather": None})


def touched(made: Fields, plan: Plan, rng: Random) -> Fields:
    """The same problem with limits of many kinds that touch this plan."""
    limited = {**made, "closures": [*made["closures"], *_closures(made, plan, rng)]}
    limited["pad_reservations"] = _reservations(made, plan, rng)
    if rng.random() < 0.5:
        limited["latest_delivery_s"] = plan.delivery_time_s
    if made.get("weather") is None and rng.random() < 0.4:
        limited["weather"] = _weather(made, plan, rng)
    if _has_windows(made) and rng.random() < 0.7:
        limited.update(_windows(made, plan))
        if plan.steps[-1].end_s < 40_000.0:
            limited["network"] = _with_hours(made, plan)
    return limited


def uses_of(made: Fields, plan: Plan) -> _Uses:
    """When the plan uses each segment, and when it lands at each station."""
    stop_s = made["drone"]["model"]["stop_s"]
    uses: _Uses = defaultdict(list)
    for step, following in zip_longest(plan.steps, plan.steps[1:]):
        if not isinstance(step, Fly):
            continue
        touch_s = step.end_s if isinstance(following, Fly) else step.end_s - stop_s
        uses[step.from_id, step.to_id].append((step.start_s, touch_s))
        if not isinstance(following, Fly):
            uses[step.to_id].append((touch_s, step.end_s))
    return uses


def _gaps(spans: list[tuple[float, float]]) -> Iterator[tuple[float, float | None]]:
    """The times before, between and after these spans; the last has no end."""
    from_s = _BEFORE_S
    for start_s, end_s in sorted(spans):
        if start_s > max(from_s, 0.0) + 1e-5:
            yield from_s, start_s
        from_s = end_s
    yield from_s, None


def _closures(made: Fields, plan: Plan, rng: Random) -> Iterator[Fields]:
    for what, spans in uses_of(made, plan).items():
        name = {"from": what[0], "to": what[1]} if isinstance(what, tuple) else {"station_id": what}
        # A closure covers its first moment, so it may not begin at a landing that takes no time.
        moments = {start_s for start_s, end_s in spans if start_s == end_s}
        for start_s, end_s in _gaps(spans):
            if start_s not in moments and rng.random() < 0.8:
                yield {**name, "start_s": start_s, "end_s": end_s}


def _reservations(made: Fields, plan: Plan, rng: Random) -> list[Fields]:
    """Every pad of most stations is reserved around the plan's sessions, in whole milliseconds."""
    sessions: dict[tuple[str, int], list[tuple[float, float]]] = defaultdict(list)
    for step in plan.steps:
        if isinstance(step, Recharge):
            span = math.floor(step.start_s * 1000 + 1e-3), math.ceil(step.end_s * 1000 - 1e-3)
            sessions[step.station_id, step.pad].append((span[0] / 1000, span[1] / 1000))
    kept = [*made["pad_reservations"]]
    for one in made["network"]["features"]:
        properties = one["properties"]
        if properties["kind"] != "station" or not properties["pads"] or rng.random() < 0.3:
            continue
        station_id = properties["station_id"]
        kept = [each for each in kept if each["station_id"] != station_id]
        for pad in range(properties["pads"]):
            kept += [
                {"station_id": station_id, "pad": pad, "start_s": start_s, "end_s": end_s}
                for start_s, end_s in _gaps(sessions[station_id, pad])
            ]
    return kept


def _weather(made: Fields, plan: Plan, rng: Random) -> Fields:
    """Weather that closes or slows each segment whenever the plan does not use it."""
    uses = {what: spans for what, spans in uses_of(made, plan).items() if isinstance(what, tuple)}
    edges = sorted({moment for spans in uses.values() for span in spans for moment in span})
    edges = [_BEFORE_S, *(edge for edge in edges if edge > 0.0)]
    # Edges that differ by rounding only are one edge.
    edges = [b for a, b in zip([-math.inf, *edges], edges, strict=False) if b > a + 1e-5]
    periods = []
    for start_s, end_s in zip(edges, [*edges[1:], None], strict=True):
        middle_s = (max(start_s, 0.0) + (start_s + 1.0 if end_s is None else end_s)) / 2
        is_used = [any(a <= middle_s <= b for a, b in spans) for spans in uses.values()]
        factors = [1.0 if used else rng.choice([None, 2.0]) for used in is_used]
        periods.append({"start_s": start_s, "end_s": end_s, "time_factors": factors})
    return {"segments": [list(what) for what in uses], "periods": periods}


def _has_windows(made: Fields) -> bool:
    names = ("not_before_s", "latest_s", "pickup_not_before_s", "pickup_latest_s")
    return any(one.get(name) is not None for one in (made, *made["packages"]) for name in names)


def _windows(made: Fields, plan: Plan) -> Fields:
    """Windows that begin and end with the acts of the plan."""
    spans = {}
    limits: Fields = {}
    for step in plan.steps:
        if isinstance(step, PickUp):
            limits = {"pickup_not_before_s": step.start_s, "pickup_latest_s": step.end_s}
        elif isinstance(step, Deliver):
            window = {"not_before_s": step.start_s, "latest_s": step.end_s}
            spans.update(dict.fromkeys(step.package_ids, window))
    packages = [{**one, **spans[one["package_id"]]} for one in made["packages"]]
    return {**limits, "packages": packages}


def _with_hours(made: Fields, plan: Plan) -> Fields:
    """Stations that are open from the whole minute before their first use to that after the last.

    Most flights last whole minutes, so many of these moments touch.
    """
    used: dict[str, list[float]] = defaultdict(list)
    for what, spans in uses_of(made, plan).items():
        if isinstance(what, str):
            used[what] += [moment for span in spans for moment in span]
    for step in plan.steps:
        if isinstance(step, PickUp | Deliver):
            used[step.station_id] += [step.start_s, step.end_s]
    features = []
    for one in made["network"]["features"]:
        moments = used.get(one["properties"].get("station_id"))
        if moments:
            opens = START_AT + timedelta(minutes=math.floor(min(moments) / 60 + 1e-9))
            closes = START_AT + timedelta(minutes=math.ceil(max(moments) / 60 - 1e-9))
            hours = {"weekly": {"sun": [f"{opens:%H:%M}-{closes:%H:%M}"]}}
            # A landing that takes no time may not be at the moment of closing.
            if closes > opens and max(moments) < (closes - START_AT).total_seconds() - 1e-5:
                features.append(
                    {**one, "properties": {**one["properties"], "opening_hours": hours}}
                )
                continue
        features.append(one)
    return {**made["network"], "features": features}
