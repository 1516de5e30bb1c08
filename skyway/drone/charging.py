"""How long a recharge takes, and how much it gives: the charge curve read in both directions."""

from bisect import bisect_left
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import floor
from typing import Final

from skyway.drone.model import ChargePoint, DroneModel
from skyway.errors import InvalidStateOfCharge
from skyway.units import CHARGE_TOLERANCE

#: Below this temperature of the air each degree lowers the charge rate by this share, down to the
#: least rate. Fast chargers raised the charge of cars' batteries by 36 % less at 0 degrees Celsius
#: than at 25 (Motoaki, Yi and Salisbury 2018, Energy Policy 122). A drone's battery comes warm from
#: its flight, so our own choice starts later: it loses 16 % at 0 degrees Celsius.
_COOL_C: Final = 10.0
_SLOWER_PER_DEGREE: Final = 0.016
_LEAST_RATE: Final = 0.25


def recharge_time_s(model: DroneModel, soc_from: float, soc_to: float) -> float:
    """Time on a pad to raise the state of charge.

    Parameters
    ----------
    soc_from, soc_to
        State of charge, `soc_from <= soc_to`, both within the model's charge curve.

    Raises
    ------
    InvalidStateOfCharge
        A value lies outside the charge curve, or the values are reversed.

    Notes
    -----
    Full recharge of the paper's drone: 2.15 h (Shahzaad and Bouguettaya, evaluation).
    """
    if soc_from > soc_to + CHARGE_TOLERANCE:
        raise InvalidStateOfCharge("soc_to", f"{soc_to} lies below soc_from {soc_from}")
    times_s, socs = model.charge_columns
    start = _on_curve(socs, "soc_from", soc_from)
    end = _on_curve(socs, "soc_to", soc_to)
    return max(0.0, _interpolate(socs, times_s, end) - _interpolate(socs, times_s, start))


def soc_after_recharge(model: DroneModel, soc_from: float, duration_s: float) -> float:
    """State of charge after so long on a pad; it never passes the top of the charge curve.

    A drone that arrives with more than the top of its curve keeps its charge.

    Raises
    ------
    InvalidStateOfCharge
        `soc_from` lies below the charge curve or above 1.
    """
    times_s, socs = model.charge_columns
    if socs[-1] <= soc_from <= 1.0:
        return soc_from
    begin_s = _interpolate(socs, times_s, _on_curve(socs, "soc_from", soc_from))
    return _interpolate(times_s, socs, begin_s + duration_s)


def fastest_s_per_soc(model: DroneModel) -> float:
    """Seconds per unit of charge just above the reserve, where charging is fastest."""
    return next(
        (after.time_s - before.time_s) / (after.soc - before.soc)
        for before, after in pairwise(model.charge_curve)
        if after.soc > model.reserve_soc or after is model.charge_curve[-1]
    )


def cold_charging_factor(temperature_c: float) -> float:
    """How many times longer charging takes in air of this temperature, degrees Celsius."""
    return 1.0 / max(_LEAST_RATE, 1.0 - _SLOWER_PER_DEGREE * max(0.0, _COOL_C - temperature_c))


def model_in_cold(model: DroneModel, temperature_c: float | None) -> DroneModel:
    """The model with the charge curve that it has in air of this temperature, in whole degrees.

    Only the drone's own charger is slower. None is a temperature that is not known: the curve stays
    as it is, as in mild air.
    """
    if temperature_c is None or temperature_c >= _COOL_C:
        return model
    return _slowed(model, cold_charging_factor(floor(temperature_c)))


@lru_cache(maxsize=1_000)
def _slowed(model: DroneModel, factor: float) -> DroneModel:
    curve = [ChargePoint(point.time_s * factor, point.soc) for point in model.charge_curve]
    return _with_curve(model, curve)


def model_on_pad(model: DroneModel, power_w: float | None) -> DroneModel:
    """The model with the charge curve that it has on a pad that gives at most this power.

    All of the power goes into the battery. Each piece of the curve takes as long as the model
    needs, or as long as the pad needs for its energy, if that is longer. So the curve keeps its
    charges and stays concave. None is a pad without a limit.
    """
    return model if power_w is None or fastest_w(model) <= power_w else _limited(model, power_w)


@lru_cache(maxsize=1_000)
def _limited(model: DroneModel, power_w: float) -> DroneModel:
    pad_s_per_soc = model.battery_j / power_w
    curve = [model.charge_curve[0]]
    for before, after in pairwise(model.charge_curve):
        piece_s = max(after.time_s - before.time_s, (after.soc - before.soc) * pad_s_per_soc)
        curve.append(ChargePoint(curve[-1].time_s + piece_s, after.soc))
    return _with_curve(model, curve)


def _with_curve(model: DroneModel, curve: Sequence[ChargePoint]) -> DroneModel:
    # Not `model_copy`: the copy would keep the charge columns that the model has cached.
    return DroneModel.model_construct(
        **{name: getattr(model, name) for name in DroneModel.model_fields}
        | {"charge_curve": tuple(curve)}
    )


def fastest_w(model: DroneModel) -> float:
    """The power of the model's charger where its curve is fastest, watts."""
    first, second = model.charge_curve[:2]
    return model.battery_j * (second.soc - first.soc) / (second.time_s - first.time_s)


def _on_curve(socs: Sequence[float], field: str, soc: float) -> float:
    lowest, top = socs[0], socs[-1]
    if lowest <= soc <= top:
        return soc
    if not lowest - CHARGE_TOLERANCE <= soc <= top + CHARGE_TOLERANCE:
        raise InvalidStateOfCharge(field, f"{soc} lies outside the charge curve, {lowest} to {top}")
    return lowest if soc < lowest else top


def _interpolate(xs: Sequence[float], ys: Sequence[float], x: float) -> float:
    """The value at `x` of the straight lines through the points; constant beyond both ends."""
    after = bisect_left(xs, x)
    if after == 0:
        return ys[0]
    if after == len(xs):
        return ys[-1]
    before_x, before_y = xs[after - 1], ys[after - 1]
    return before_y + (ys[after] - before_y) * ((x - before_x) / (xs[after] - before_x))
