"""Changes of a problem after which the best plan is never later.

A faster drone is only sure to gain where nothing closes: in the air nobody waits, so a drone can
come to a segment too early, and a landing to wait for it costs energy. A bigger battery keeps its
curve's times, so every joule is charged no slower than before, and keeps its reserve in joules; and
only `partial` recharging gains from it, since a full session takes longer.
"""

import math
from collections.abc import Callable
from typing import Any

import pytest

from skyway.planner import compose
from skyway.planner.problem import Problem
from tests.library.planner.oracles.instances import as_json
from tests.long_cases import sampled

Fields = dict[str, Any]
#: The changed problem, and what it is measured against; None where the change may hurt.
Change = Callable[[Fields], tuple[Fields, Fields] | None]

_SLACK_S = 1e-3


def _with_model(fields: Fields, **changed: Any) -> Fields:
    drone = fields["drone"]
    return {**fields, "drone": {**drone, "model": {**drone["model"], **changed}}}


def _with_features(fields: Fields, features: list[Any]) -> Fields:
    return {**fields, "network": {**fields["network"], "features": features}}


def _open_sky(fields: Fields) -> Fields:
    kept = [one for one in fields["network"]["features"] if one["properties"]["kind"] != "zone"]
    return {**_with_features(fields, kept), "closures": []}


def _one_more_pad_everywhere(fields: Fields) -> tuple[Fields, Fields]:
    features = [
        {**one, "properties": {**one["properties"], "pads": one["properties"]["pads"] + 1}}
        if one["properties"]["kind"] == "station"
        else one
        for one in fields["network"]["features"]
    ]
    return _with_features(fields, features), fields


def _a_reservation_less(fields: Fields) -> tuple[Fields, Fields]:
    return {**fields, "pad_reservations": fields["pad_reservations"][1:]}, fields


def _a_closure_less(fields: Fields) -> tuple[Fields, Fields]:
    return {**fields, "closures": fields["closures"][1:]}, fields


def _no_zones(fields: Fields) -> tuple[Fields, Fields]:
    return {**_open_sky(fields), "closures": fields["closures"]}, fields


def _a_full_battery_at_the_start(fields: Fields) -> tuple[Fields, Fields]:
    return {**fields, "drone": {**fields["drone"], "soc": 1.0}}, fields


def _partial_recharging(fields: Fields) -> tuple[Fields, Fields]:
    full = {**fields, "recharge_policy": "full"}
    return {**fields, "recharge_policy": "partial"}, full


def _staying_where_it_delivers(fields: Fields) -> tuple[Fields, Fields]:
    return {**fields, "finish": "stay"}, {**fields, "finish": "recharge"}


def _landings_that_cost_no_energy(fields: Fields) -> tuple[Fields, Fields]:
    return _with_model(fields, stop_j=0.0), fields


def _faster_at_the_same_energy_a_metre(fields: Fields) -> tuple[Fields, Fields]:
    open_sky, model = _open_sky(fields), fields["drone"]["model"]
    names = ("speed_empty_mps", "speed_full_mps", "power_empty_w")
    return _with_model(open_sky, **{name: 1.3 * model[name] for name in names}), open_sky


def _a_bigger_battery(fields: Fields) -> tuple[Fields, Fields] | None:
    model = fields["drone"]["model"]
    (_, first), *_ = model["charge_curve"]
    if first > 0:
        return None
    partial = {**fields, "recharge_policy": "partial"}
    bigger = _with_model(
        partial, battery_j=1.3 * model["battery_j"], reserve_soc=model["reserve_soc"] / 1.3
    )
    return bigger, partial


def _a_charge_curve_twice_as_fast(fields: Fields) -> tuple[Fields, Fields]:
    curve = fields["drone"]["model"]["charge_curve"]
    return _with_model(fields, charge_curve=[(time_s / 2, soc) for time_s, soc in curve]), fields


def _more_time(fields: Fields) -> tuple[Fields, Fields]:
    return {**fields, "latest_delivery_s": None}, fields


@pytest.mark.parametrize("first", sampled(range(3000, 3040, 10), every=4))
@pytest.mark.parametrize(
    "change",
    [
        _one_more_pad_everywhere,
        _a_reservation_less,
        _a_closure_less,
        _no_zones,
        _a_full_battery_at_the_start,
        _partial_recharging,
        _staying_where_it_delivers,
        _landings_that_cost_no_energy,
        _faster_at_the_same_energy_a_metre,
        _a_bigger_battery,
        _a_charge_curve_twice_as_fast,
        _more_time,
    ],
)
def test_the_best_plan_is_not_later_with(change: Change, first: int) -> None:
    later = {}
    for seed in range(first, first + 10):
        pair = change(as_json(seed))
        if pair is None:
            continue
        better_s, before_s = (_time_s(fields) for fields in pair)
        if better_s > before_s + _SLACK_S:
            later[seed] = (before_s, better_s)

    assert later == {}


def _time_s(fields: Fields) -> float:
    plan = compose(Problem.model_validate(fields))
    assert plan.status in ("optimal", "infeasible")
    return math.inf if plan.delivery_time_s is None else plan.delivery_time_s
