"""The lateness that nine of ten packages do not exceed, learned from packages that have come.

The method is localized conformal prediction (Guan 2023). The score of a package is its lateness as
a share of its planned time. A past package counts the more, the more alike the conditions are that
were known when both were promised: the weather, and how long the plan flies and charges in it. Sort
the scores, and take the first one up to which the scores have the needed share of the weight. While
hardly any past package is alike, all of them count a little.

The needed share adapts: it rises with each alike package that came after its P90, and falls with
the others (Gibbs and Candes 2021). It adapts by kind of weather, and by number of recharges, so
that nine of ten packages come in time in each of these groups (Bastani et al. 2022).

A provider with few packages borrows from the other providers of its network, with weights (Barber,
Candes, Ramdas and Tibshirani 2023). For a new provider all others together weigh as much as
`BORROWED` packages, and less the more packages of its own it has. Each of the other
providers weighs the same, so the largest provider counts no more than the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp
from typing import Annotated, Final, Literal, NamedTuple, Self

from pydantic import Field

from skyway.delivery.plan import Plan, Recharge
from skyway.json_model import JsonModel

#: The share of packages that should come by their P90.
COVERED: Final = 0.9
#: With fewer packages no P90 is known. Our own choice.
FEWEST: Final = 40
#: All other providers of the network together weigh as much as so many packages for a new provider,
#: which then has a P90. They weigh half as much when the provider has so many packages of its own.
#: Our own choice, as is the next number.
BORROWED: Final = FEWEST
#: The last packages of each other provider that count.
_OF_OTHERS: Final = 60
#: How far the level moves with one package of the same weather, and of the same number of
#: recharges, and its limits. Our own choice.
_STEP_WEATHER: Final = 0.06
_STEP_RECHARGES: Final = 0.03
_LEVELS: Final = (0.6, 0.99)
#: Packages are alike if these differ by little: degrees Celsius, metres per second, and shares of
#: the planned time. A package counts for exp(-1/2) if one of them differs by so much. A strong wind
#: is known less well, so winds and their lateness may differ by a share more. Our own choice, as
#: are the next numbers.
_NEAR_C: Final = 6.0
_NEAR_MPS, _NEAR_LATE, _NEAR_SHARE = 1.0, 0.03, 0.15
_NEAR_RECHARGING: Final = 0.15
#: What a package counts if one of both plans recharges and the other does not, and if nothing is
#: alike.
_OTHER_RECHARGING: Final = 0.4
_NOT_ALIKE: Final = 0.003
#: So many recharges and more are one group.
MOST_RECHARGES: Final = 3
#: So that n + 1 times n / (n + 1) is n.
_ROUNDING: Final = 1e-9
#: Shorter planned times count as this, seconds: a minute must not become a large share.
_SHORTEST_S: Final = 300.0
#: The largest share of its planned time by which a package counts as late: a package that lay for
#: days says nothing about the others. Our own choice.
_LARGEST_SHARE: Final = 3.0


#: The weather of a group is cold below this temperature, degrees Celsius, else windy and stormy
#: from these winds on, metres per second. Our own choice, for people who look at the groups.
_COLD_C: Final = 5.0
_WINDY_MPS, _STORMY_MPS = 2.0, 6.0


KnownBy = Literal["FORECAST", "MEASURED"]
Weather = Literal["CALM", "WINDY", "STORMY", "COLD"]


class ConditionsGroup(NamedTuple):
    """Conditions as people see them; the number of recharges ends at `MOST_RECHARGES`."""

    known_by: KnownBy | None
    weather: Weather | None
    recharges: int


class KnownAir(JsonModel):
    """What is known of the air when a plan is made: by a forecast, or as the fleet measures it."""

    source: KnownBy
    wind_mps: Annotated[
        float, Field(ge=0, description="Mean wind on the plan's flights, metres per second.")
    ]
    temperature_c: Annotated[float, Field(description="Temperature of the air, degrees Celsius.")]

    @property
    def weather(self) -> Weather:
        """The weather in a word."""
        if self.temperature_c < _COLD_C:
            return "COLD"
        if self.wind_mps < _WINDY_MPS:
            return "CALM"
        return "WINDY" if self.wind_mps < _STORMY_MPS else "STORMY"


class Conditions(JsonModel):
    """What is known about a plan when its packages are promised.

    `late_share` is the lateness that the wind explains, and `recharging_share` the time on pads,
    both as shares of the planned time. Without `air` nothing is known about the weather.
    """

    air: KnownAir | None = None
    late_share: Annotated[float, Field(ge=0)] = 0.0
    recharges: Annotated[int, Field(ge=0)] = 0
    recharging_share: Annotated[float, Field(ge=0, le=1)] = 0.0

    @classmethod
    def of(
        cls,
        air: KnownAir | None,
        late_share: float | None,
        *,
        planned_s: float,
        recharges: int,
        recharging_s: float,
    ) -> Self:
        """What is known about a plan that delivers after `planned_s`, with so long on pads."""
        share = round(min(1.0, recharging_s / max(planned_s, _SHORTEST_S)), 3)
        return cls(
            air=air, late_share=late_share or 0.0, recharges=recharges, recharging_share=share
        )

    @classmethod
    def of_plan(cls, plan: Plan, air: KnownAir | None, late_share: float | None) -> Self:
        """What is known about a plan in this air."""
        return cls.of(
            air,
            late_share,
            planned_s=plan.delivery_time_s or 0.0,
            recharges=sum(isinstance(step, Recharge) for step in plan.steps),
            recharging_s=plan.recharging_s or 0.0,
        )

    @property
    def group(self) -> ConditionsGroup:
        """The group for which coverage is shown."""
        recharges = min(self.recharges, MOST_RECHARGES)
        if self.air is None:
            return ConditionsGroup(None, None, recharges)
        return ConditionsGroup(self.air.source, self.air.weather, recharges)


#: Nothing is known about the plan of a package.
UNKNOWN: Final = Conditions()


@dataclass(frozen=True, slots=True)
class PackageArrival:
    """A package that has come: its planned time from the drone's start, and its lateness, seconds.

    `was_covered` says whether it came by its P90; None if it had none. `known` is what was known
    when it was promised.
    """

    planned_s: float
    late_s: float
    was_covered: bool | None
    known: Conditions = UNKNOWN


def late_share(
    known: Conditions,
    own: Sequence[PackageArrival],
    others: Sequence[Sequence[PackageArrival]] = (),
) -> float | None:
    """The lateness that nine of ten packages do not exceed, as a share of the planned time.

    `known` is what is known about the plan of a package that is promised now. `own` are the
    packages of its provider, and `others` those of each other provider of the network, in the order
    in which they came. At least 0; None if all together weigh less than `FEWEST`.
    """
    groups = [each[-_OF_OTHERS:] for each in others if each]
    borrowed = min(BORROWED**2 / (BORROWED + len(own)), sum(map(len, groups)))
    count = len(own) + borrowed
    if count < FEWEST - _ROUNDING:
        return None
    parts = [(own, 1.0)]
    parts.extend((each, borrowed / len(groups) / len(each)) for each in groups)
    scores: list[tuple[float, float]] = []
    level = 0.0
    for arrivals, weight in parts:
        same = [_same_weather(known.air, each.known.air) for each in arrivals]
        scores.extend(
            (_score(each), weight * (_NOT_ALIKE + weather * _alike(known, each.known)))
            for each, weather in zip(arrivals, same, strict=True)
        )
        level += weight * len(arrivals) / count * _level(known, arrivals, same)
    whole = sum(weight for _, weight in scores)
    # Packages of different weights say as much as so many equal ones (Kish 1965), and n packages
    # support no higher level than n / (n + 1).
    equal = min(count, whole**2 / sum(weight**2 for _, weight in scores))
    needed = whole * min(level * (1 + 1 / equal), 1.0) - _ROUNDING
    return min(max(0.0, _weighted(scores, needed)), _LARGEST_SHARE)


def later_by_s(planned_s: float, share: float) -> float:
    """How much later a package with this planned time may come, seconds."""
    return share * max(planned_s, _SHORTEST_S)


def _score(arrival: PackageArrival) -> float:
    return arrival.late_s / max(arrival.planned_s, _SHORTEST_S)


def _alike(one: Conditions, other: Conditions) -> float:
    """How much one plan says about another one in the same weather, 0 to 1."""
    apart = _apart(one.late_share, other.late_share, near=_NEAR_LATE) ** 2
    apart += ((one.recharging_share - other.recharging_share) / _NEAR_RECHARGING) ** 2
    same = 1.0 if (one.recharges > 0) == (other.recharges > 0) else _OTHER_RECHARGING
    return same * exp(-apart / 2)


def _same_weather(one: KnownAir | None, other: KnownAir | None) -> float:
    """How alike the weather is, 0 to 1; 0 if the one is forecast and the other measured."""
    if one is None or other is None:
        return float(one is other)
    if one.source != other.source:
        return 0.0
    apart = ((one.temperature_c - other.temperature_c) / _NEAR_C) ** 2
    apart += _apart(one.wind_mps, other.wind_mps, near=_NEAR_MPS) ** 2
    return exp(-apart / 2)


def _apart(one: float, other: float, *, near: float) -> float:
    """How far two values of the wind are apart; 1 if they are as near as counts as alike."""
    return (one - other) / (near + _NEAR_SHARE * max(one, other))


def _weighted(scores: Sequence[tuple[float, float]], needed: float) -> float:
    """The least score such that the scores up to it weigh as much as `needed`."""
    *smaller, (largest, _) = sorted(scores)
    for score, weight in smaller:
        needed -= weight
        if needed <= 0:
            return score
    return largest


def _level(
    known: Conditions, arrivals: Sequence[PackageArrival], same_weather: Sequence[float]
) -> float:
    """The level that the packages which came so far support under these conditions."""
    level, source = COVERED, None if known.air is None else known.air.source
    recharges = min(known.recharges, MOST_RECHARGES)
    for each, weather in zip(arrivals, same_weather, strict=True):
        if each.was_covered is None:
            continue
        step, air = _STEP_WEATHER * weather, each.known.air
        if source == (None if air is None else air.source) and recharges == min(
            each.known.recharges, MOST_RECHARGES
        ):
            step += _STEP_RECHARGES
        level += step * (COVERED - each.was_covered)
        level = min(max(level, _LEVELS[0]), _LEVELS[1])
    return level
