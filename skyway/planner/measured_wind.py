"""The wind that drones measure: the air of a network without a forecast, or what corrects one.

Each provider has one vote, the median of its drones. A forecast has a vote too, at each place. The
median of all votes counts, so the drones of one provider do not change a forecast alone.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from math import hypot, sqrt
from statistics import median
from typing import Final

import numpy as np

from skyway.planner.forecast import MILD_C, Forecast
from skyway.planner.wind import nearest_places, weights_of
from skyway.units import moment_to_ms

#: How old, and how far from a place, a measurement may be that counts there; seconds and metres.
RECENT_S: Final = 900.0
NEAR_M: Final = 50_000.0

#: Corrections are multiples of the step and have a largest value, metres per second. Plans then
#: change only when the wind is clearly different.
_STEP_MPS: Final = 0.5
_MOST_MPS: Final = 15.0

#: The strongest wind that the drones of one provider alone can report for a network without a
#: forecast, metres per second. Our own choice.
_MOST_ALONE_MPS: Final = 10.0

#: The standard deviation of gusts near the ground, as a share of the mean wind. Our own choice.
_GUSTS: Final = 0.33

#: How long measured air holds for the flights of a plan, seconds. Our own choice: if it faded soon,
#: plans would wait for a calm of which nothing is known.
HOLDS_S: Final = 86_400.0

#: The temperatures at which batteries of drones work, degrees Celsius (those of the DJI TB60 from
#: -20 to 50). A faulty or lying drone may report others.
_COLDEST_C, _WARMEST_C = -20.0, 60.0

#: What is left of a correction after each hour. Our own choice: after some hours the weather has
#: changed.
_LEFT_AN_HOUR: Final = 0.5
_HOUR_S: Final = 3_600.0

#: The wind by which a place is corrected: to the east and north, metres per second.
Correction = tuple[float, float]


@dataclass(frozen=True, slots=True)
class MeasuredAir:
    """How fast the air moves to the east and to the north, and its temperature, as measured."""

    east_mps: float
    north_mps: float
    temperature_c: float = MILD_C
    #: How many drones have measured it.
    drones: int = 1

    @property
    def error_mps(self) -> float:
        """The standard error of the wind of a flight: its own gusts, and those of the mean.

        Gusts grow with the wind. Rounded down to a multiple of the step: in calm air it is 0.
        """
        gust_mps = _GUSTS * hypot(self.east_mps, self.north_mps)
        return gust_mps * sqrt(1 + 1 / self.drones) // _STEP_MPS * _STEP_MPS

    def averaged(self, earlier: Correction) -> "MeasuredAir":
        """The same air with the mean of its wind and an earlier wind: gusts average out."""
        east_mps, north_mps = earlier
        return replace(
            self,
            east_mps=_in_steps((self.east_mps + east_mps) / 2),
            north_mps=_in_steps((self.north_mps + north_mps) / 2),
        )

    @property
    def by_name(self) -> dict[str, float]:
        """The values by the names that a forecast has for them."""
        return {
            "eastward_wind_mps": self.east_mps,
            "northward_wind_mps": self.north_mps,
            "temperature_c": self.temperature_c,
            "error_mps": self.error_mps,
        }


@dataclass(frozen=True, slots=True)
class Measurement:
    """The wind that one drone has measured: how fast the air moves to the east and to the north."""

    provider_id: str
    longitude_deg: float
    latitude_deg: float
    at_s: float
    east_mps: float
    north_mps: float
    temperature_c: float = MILD_C


def measurements_of(states: Iterable[tuple[str, str]]) -> Iterator[Measurement]:
    """The air that drones in flight have measured; `states` are providers and JSON of DroneState.

    The temperature is that of the battery, which decides how fast it charges.
    """
    for provider_id, text in states:
        # Only some members are needed: reading states as models takes several times as long.
        state = json.loads(text)
        health = state.get("health") or {}
        wind = health.get("wind")
        if state["activity"] != "FLYING" or wind is None or state.get("position") is None:
            continue
        longitude_deg, latitude_deg = state["position"]
        yield Measurement(
            provider_id=provider_id,
            longitude_deg=longitude_deg,
            latitude_deg=latitude_deg,
            at_s=moment_to_ms(datetime.fromisoformat(state["at"])) / 1000,
            east_mps=wind["east_mps"],
            north_mps=wind["north_mps"],
            temperature_c=health.get("temperature_c", MILD_C),
        )


def air_of(measured: Iterable[Measurement], *, now_s: float) -> MeasuredAir | None:
    """The air of a network without a forecast; None if no drone has measured it lately.

    Of two middle votes the vote nearer to still and mild air counts. If the drones of one provider
    alone have measured, a wind above `_MOST_ALONE_MPS` counts as this: a lie then slows all plans,
    but closes no segment to drones that fly in such a wind.
    """
    by_provider: dict[str, list[Measurement]] = defaultdict(list)
    for each in measured:
        if abs(now_s - each.at_s) <= RECENT_S:
            by_provider[each.provider_id].append(each)
    if not by_provider:
        return None

    def votes(value: Callable[[Measurement], float]) -> list[float]:
        return [median(map(value, own)) for own in by_provider.values()]

    east_mps, north_mps = votes(lambda each: each.east_mps), votes(lambda each: each.north_mps)
    if len(by_provider) == 1:
        most = min(1.0, _MOST_ALONE_MPS / max(hypot(east_mps[0], north_mps[0]), _STEP_MPS))
        east_mps, north_mps = [most * east_mps[0]], [most * north_mps[0]]
    warmer_c = _middle(votes(lambda each: each.temperature_c - MILD_C))
    return MeasuredAir(
        east_mps=_rounded(east_mps),
        north_mps=_rounded(north_mps),
        drones=sum(map(len, by_provider.values())),
        temperature_c=round(min(max(MILD_C + warmer_c, _COLDEST_C), _WARMEST_C)),
    )


def corrections_of(
    forecast: Forecast, measured: Iterable[Measurement], *, now_s: float
) -> dict[int, Correction]:
    """The corrections of places of the forecast, by the number of the place, from 0.

    Places without a correction are left out.
    """
    recent = [each for each in measured if abs(now_s - each.at_s) <= RECENT_S]
    field = forecast.field()
    period = int(np.searchsorted(field.edges_s, now_s, side="right")) - 1
    if not recent or not 0 <= period < len(field.edges_s) - 1:
        return {}
    longitude_deg = np.array([each.longitude_deg for each in recent])
    latitude_deg = np.array([each.latitude_deg for each in recent])
    weights = weights_of(field, longitude_deg=longitude_deg, latitude_deg=latitude_deg)
    now = slice(period, period + 1)
    expected = np.stack((weights.of(field.east_mps[now])[0], weights.of(field.north_mps[now])[0]))
    measured_mps = np.array([(each.east_mps, each.north_mps) for each in recent]).T
    places, far_m = nearest_places(field, longitude_deg=longitude_deg, latitude_deg=latitude_deg)
    votes: dict[int, dict[str, list[Correction]]] = defaultdict(lambda: defaultdict(list))
    for number, each in enumerate(recent):
        east_mps, north_mps = (measured_mps - expected)[:, number].tolist()
        for place in places[far_m[:, number] <= NEAR_M, number].tolist():
            votes[place][each.provider_id].append((east_mps, north_mps))
    found = {place: _decided(by_provider) for place, by_provider in sorted(votes.items())}
    return {place: correction for place, correction in found.items() if correction != (0.0, 0.0)}


def corrected(
    forecast: Forecast, corrections: Mapping[int, Correction], *, at_s: float
) -> Forecast:
    """The forecast with corrections that were found at this moment; each hour halves them."""
    places = np.array([*corrections], np.int64)
    late_s = np.maximum(0.0, forecast.edges_s[:-1] - at_s)
    left = np.where(forecast.edges_s[1:] > at_s, _LEFT_AN_HOUR ** (late_s / _HOUR_S), 0.0)
    east_mps, north_mps = forecast.east_mps.copy(), forecast.north_mps.copy()
    for column, (east, north) in zip(places, corrections.values(), strict=True):
        east_mps[:, column] += left * east
        north_mps[:, column] += left * north
    return replace(forecast, east_mps=east_mps, north_mps=north_mps)


def _decided(by_provider: Mapping[str, Sequence[Correction]]) -> Correction:
    """The median vote to the east and to the north; the forecast votes for no correction."""
    east_mps, north_mps = (
        _rounded([0.0, *(median(each[part] for each in given) for given in by_provider.values())])
        for part in (0, 1)
    )
    return east_mps, north_mps


def _rounded(votes_mps: Sequence[float]) -> float:
    """The median vote in steps, within the limit."""
    return _in_steps(min(_MOST_MPS, max(-_MOST_MPS, _middle(votes_mps))))


def _in_steps(wind_mps: float) -> float:
    return round(wind_mps / _STEP_MPS) * _STEP_MPS + 0.0


def _middle(votes: Sequence[float]) -> float:
    """The median vote; of two middle votes the vote nearer to 0."""
    ordered = sorted(votes)
    middle = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    return min(middle, key=abs)
