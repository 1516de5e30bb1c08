"""The cases: one hour of requests, drawn as `skyway experiment --only fleet` draws it.

A city of 40 stations, the Texas corridor, or a city whose packages all come from three hubs. Every
station has one pad. The drones (`dji-matrice-300-rtk`, plans add 15 % of energy) begin charged, at
homes all over the network. A request has one or two packages, for stations within 25 km. It is due
30 minutes after it came, or twice the time that it would need alone on the whole fleet.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

from skyway.dispatch.problem import FleetDrone, FleetProblem, FleetRequest
from skyway.dispatch.schedule import Scheduler
from skyway.ids import StationId
from skyway_lab.experiments.fleet_hour.calendars import HAND_OVER_MS, MODEL, PAD_GAP_MS
from skyway_lab.experiments.fleet_hour.cases import Case, HourRequest, Load, Place, draw_case

#: From a plan until its first trip can begin, seconds, as in the services.
PREPARE_S: Final = 60.0

#: What the services use for loading and each hand-over, seconds.
_LOADING_S: Final = 60.0
_DROPOFF_S: Final = 30.0

#: The least time that a customer grants, seconds.
_LEAST_GRANTED_S: Final = 1_800.0


@dataclass(frozen=True, slots=True)
class FleetCase:
    """A drawn hour; `granted_s` is by request the time until it is due."""

    name: str
    hour: Case
    granted_s: Sequence[float]

    def problem(
        self,
        drones: Sequence[FleetDrone],
        requests: Sequence[HourRequest],
        *,
        now_ms: int,
        pooling: bool,
        **fields: object,
    ) -> FleetProblem:
        """The fleet problem of these requests at a moment of the hour."""
        return FleetProblem.model_validate(
            {
                "network": self.hour.network,
                "drones": tuple(drones),
                "requests": [
                    request_of(each, self.granted_s[each.number], now_ms=now_ms, pooling=pooling)
                    for each in requests
                ],
                "loading_s": _LOADING_S,
                "dropoff_s": _DROPOFF_S,
                "hand_over_s": HAND_OVER_MS / 1000,
                "pad_gap_s": PAD_GAP_MS / 1000,
                "prices": {"lateness": 0.0},
                **fields,
            }
        )

    def known_together(self, *, pooling: bool) -> FleetProblem:
        """All requests of the hour, as if they had come when it began."""
        requests = [
            HourRequest(each.number, 0, each.source, each.packages) for each in self.hour.requests
        ]
        return self.problem(drones_at_home(self.hour), requests, now_ms=0, pooling=pooling)


def request_of(asked: HourRequest, granted_s: float, *, now_ms: int, pooling: bool) -> FleetRequest:
    """The request as the dispatcher reads it; its packages get names of their own."""
    known_s, now_s = (asked.asked_ms - now_ms) / 1000, now_ms / 1000
    return FleetRequest(
        request_id=str(asked.number),
        source=asked.source,
        packages=tuple(
            each.model_copy(
                update={
                    "package_id": f"{asked.number}-{each.package_id}",
                    "not_before_s": None
                    if each.not_before_s is None
                    else each.not_before_s - now_s,
                }
            )
            for each in asked.packages
        ),
        known_s=known_s,
        deadline_s=known_s + granted_s,
        pooling=pooling,
    )


def drones_at_home(hour: Case) -> list[FleetDrone]:
    """The fleet before its first trip."""
    return [
        drone(number, home, free_s=PREPARE_S, soc=MODEL.top_soc)
        for number, home in enumerate(hour.homes)
    ]


def drone(number: int, station_id: StationId, *, free_s: float, soc: float) -> FleetDrone:
    """One drone of a fleet."""
    return FleetDrone.model_validate(
        {
            "drone_id": f"d{number}",
            "model": MODEL,
            "station_id": station_id,
            "free_s": free_s,
            "soc": soc,
        }
    )


@cache
def fleet_case(place: Place, load: Load, *, seed: int) -> FleetCase:
    """The case that this seed draws."""
    hour = draw_case(place, load, seed=seed)
    together = FleetCase(str(place), hour, [0.0] * len(hour.requests)).known_together(pooling=False)
    scheduler = Scheduler(together)
    alone_s = [scheduler.alone_s(each) for each in range(len(hour.requests))]
    granted_s = [max(_LEAST_GRANTED_S, 2 * each) for each in alone_s]
    return FleetCase(f"{place}, {load}", hour, granted_s)
