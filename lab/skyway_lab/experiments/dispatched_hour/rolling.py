"""A rolling hour: each minute the policy plans all requests that have not started.

If requests wait in shorter batches, it also plans when a batch ends.

While requests still come, trips may wait for more requests that may share them. The drone of such a
trip may fly ahead to the pickup, without packages. A drone that waits stands where its last flight
ended, and charges while the pad there is free. Trips get the pad first, then the drone that has
stood there longest. All flights go as planned.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import mean
from typing import Final

from skyway.delivery.request import WINDOW_WEIGHT
from skyway.dispatch.pads import HeldPad
from skyway.dispatch.planned_trip import PlannedTrip
from skyway.dispatch.pools import waits_for_more
from skyway.dispatch.problem import CurrentTrip, FleetDrone, FleetProblem, FleetRequest
from skyway.dispatch.schedule import Schedule, Scheduler
from skyway.drone.charging import soc_after_recharge
from skyway.ids import PackageId, StationId
from skyway.planner.problem_parts import PackageToDeliver, PadReservation
from skyway_lab.experiments.dispatched_hour.cases import PREPARE_S, FleetCase, drone
from skyway_lab.experiments.dispatched_hour.policies import FAR_S, DispatchPolicy
from skyway_lab.experiments.fleet_hour.calendars import HAND_OVER_MS, MODEL, PAD_GAP_MS
from skyway_lab.experiments.fleet_hour.cases import HOUR_MS, HourRequest

_TICK_MS: Final = 60_000
_PREPARE_MS: Final = round(PREPARE_S * 1000)

#: After so many minutes the hour ends, even if requests are left.
_MOST_TICKS: Final = 2_880


@dataclass(slots=True)
class _Drone:
    """Where a drone is free, from when, and its charge at `charged_ms`, then or later."""

    station_id: StationId
    free_ms: int
    soc: float
    charged_ms: int


@dataclass(slots=True)
class RollingHour:
    """The state of one hour; `delivered_ms` and `promised_ms` are by the number of the request.

    The promise is when the plan of the moment at which it becomes firm delivers the request.
    `flights_ahead` counts the flights to pickups without packages.
    """

    case: FleetCase
    policy: DispatchPolicy
    seed: int
    delivered_ms: dict[int, int] = field(default_factory=dict)
    promised_ms: dict[int, int] = field(default_factory=dict)
    energy_j: float = 0.0
    flights_ahead: int = 0
    _drones: list[_Drone] = field(init=False)
    _pads: list[HeldPad] = field(default_factory=list)
    _planned: dict[int, tuple[str, int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._drones = [_Drone(home, 0, MODEL.top_soc, 0) for home in self.case.hour.homes]

    def run(self) -> None:
        """Fly the hour until every request is served."""
        for now_ms, next_ms in pairwise(self._moments_ms()):
            self._charge(now_ms + _PREPARE_MS)
            open_requests = [
                each
                for each in self.case.hour.requests
                if each.asked_ms <= now_ms and each.number not in self.delivered_ms
            ]
            if open_requests:
                problem = self._problem(open_requests, now_ms)
                schedule = self.policy.plan(problem, self.seed + now_ms // _TICK_MS)
                self._begin(problem, schedule, open_requests, now_ms, next_ms)
            if len(self.delivered_ms) == len(self.case.hour.requests):
                return

    def _moments_ms(self) -> list[int]:
        """When the open requests are planned: each minute, and when a batch ends."""
        batch_ms = round(1000 * self.policy.batch_s)
        ends_ms = {-(-each.asked_ms // batch_ms) * batch_ms for each in self.case.hour.requests}
        return sorted(ends_ms | {tick * _TICK_MS for tick in range(_MOST_TICKS)})

    def waited_s(self) -> dict[int, float]:
        """From each served request to its last delivery, by its number."""
        asked_ms = {each.number: each.asked_ms for each in self.case.hour.requests}
        return {
            number: (moment_ms - asked_ms[number]) / 1000
            for number, moment_ms in self.delivered_ms.items()
        }

    def width_s(self, number: int) -> float | None:
        """The width of a request's promise; None while or if it has none."""
        least_s = self.policy.promise_tolerance_s
        if least_s is None or number not in self.promised_ms:
            return None
        asked, promised_s = self.case.hour.requests[number], self.promised_ms[number] / 1000
        width_s = least_s + self.policy.wider_by * max(
            0.0, promised_s - asked.asked_ms / 1000 - FAR_S
        )
        end_s = self._window_end_s(number)
        return width_s if end_s is None else max(width_s, end_s - promised_s)

    def _window_end_s(self, number: int) -> float | None:
        """Until when a delivery with a window is promised; None without such a promise."""
        begin_s = self.case.hour.requests[number].packages[0].not_before_s
        if begin_s is None or self.policy.window_s == 0:
            return None
        return begin_s + self.policy.window_s

    @property
    def mean_min(self) -> float:
        """Mean minutes from each served request to its last delivery."""
        return mean(self.waited_s().values()) / 60

    @property
    def served_share(self) -> float:
        """The share of requests that are served."""
        return len(self.delivered_ms) / len(self.case.hour.requests)

    def _problem(self, requests: Sequence[HourRequest], now_ms: int) -> FleetProblem:
        problem = self.case.problem(
            [self._drone(number, now_ms) for number in range(len(self._drones))],
            requests,
            now_ms=now_ms,
            pooling=self.policy.pooling,
            prices={
                "lateness": 0.0,
                "energy_s_per_kwh": self.policy.energy_s_per_kwh if now_ms < HOUR_MS else 0.0,
            },
            pad_reservations=self._reservations(now_ms),
        )
        planned = [
            each.model_copy(
                update={
                    "planned": self._planned_trip(int(each.request_id), now_ms),
                    "promised_s": self._promised_s(int(each.request_id), now_ms),
                    "weight": 1.0
                    if self._window_end_s(int(each.request_id)) is None
                    else WINDOW_WEIGHT,
                }
            )
            for each in problem.requests
        ]
        changed: dict[str, object] = {"requests": tuple(planned)}
        if self.policy.promise_tolerance_s is not None:
            # What is promised counts from the first plan on, not from the arrival order.
            changed |= {"baseline": "current plan", "promise_tolerance_s": 0.0}
        return problem.model_copy(update=changed)

    def _reservations(self, now_ms: int) -> tuple[PadReservation, ...]:
        return tuple(
            PadReservation(
                station_id=each.station_id,
                pad=each.pad,
                start_s=(each.start_ms - now_ms) / 1000,
                end_s=(each.end_ms - now_ms) / 1000,
            )
            for each in self._pads
            if each.end_ms > now_ms
        )

    def _promised_s(self, number: int, now_ms: int) -> float | None:
        """The latest delivery that keeps the promise; None without promises."""
        width_s = self.width_s(number)
        if width_s is None:
            end_s = self._window_end_s(number)
            return None if end_s is None else end_s - now_ms / 1000
        return (self.promised_ms[number] - now_ms) / 1000 + width_s

    def _planned_trip(self, number: int, now_ms: int) -> CurrentTrip | None:
        if number not in self._planned:
            return None
        drone_id, start_ms = self._planned[number]
        return CurrentTrip.model_validate(
            {"drone_id": drone_id, "start_s": (start_ms - now_ms) / 1000}
        )

    def _drone(self, number: int, now_ms: int) -> FleetDrone:
        state = self._drones[number]
        free_ms = max(state.free_ms, now_ms + _PREPARE_MS)
        return drone(number, state.station_id, free_s=(free_ms - now_ms) / 1000, soc=state.soc)

    def _begin(
        self,
        problem: FleetProblem,
        schedule: Schedule,
        requests: Sequence[HourRequest],
        now_ms: int,
        next_ms: int,
    ) -> None:
        """Start the trips that begin before the next plan could; remember the others."""
        self._planned = {}
        until_ms = next_ms + _PREPARE_MS
        most_wait_s = self.policy.most_wait_s if now_ms < HOUR_MS else 0.0
        waiting: dict[int, PlannedTrip] = {}
        for number, trip in sorted(schedule.trips, key=lambda each: each.trip.slot.at_ms):
            start_ms = now_ms + trip.slot.at_ms
            if waits_for_more(problem, trip.pool, most_wait_s=most_wait_s):
                waiting.setdefault(number, trip)
            may_wait = start_ms < until_ms and self._begins_early(problem, number, trip)
            if number in waiting or may_wait:
                start_ms = max(start_ms, until_ms)
            for each, moment_ms in zip(trip.pool, trip.delivered_ms, strict=True):
                firm_ms = requests[each].asked_ms + 1000 * self.policy.firm_within_s
                if firm_ms < next_ms or start_ms < until_ms:
                    self.promised_ms.setdefault(requests[each].number, now_ms + moment_ms)
            if start_ms >= until_ms:
                for each in trip.pool:
                    self._planned[requests[each].number] = f"d{number}", start_ms
                continue
            for each, moment_ms in zip(trip.pool, trip.delivered_ms, strict=True):
                self.delivered_ms[requests[each].number] = now_ms + moment_ms
            self._fly(number, trip, now_ms)
        for number, trip in waiting.items():
            self._fly_ahead(problem, number, trip, now_ms)

    def _fly(self, number: int, trip: PlannedTrip, now_ms: int) -> None:
        """Let a drone fly this trip as planned."""
        self.energy_j += trip.energy_j
        self._pads += [
            each._replace(start_ms=each.start_ms + now_ms, end_ms=each.end_ms + now_ms)
            for each in trip.pads
        ]
        end_ms = now_ms + trip.end.at_ms
        self._drones[number] = _Drone(
            trip.end.station_id, end_ms + HAND_OVER_MS, trip.end.soc, end_ms
        )

    def _fly_ahead(
        self, problem: FleetProblem, number: int, waiting: PlannedTrip, now_ms: int
    ) -> None:
        """Fly a drone to the pickup of its waiting trip if it must not leave a minute later."""
        ahead_s = self.policy.ahead_s
        pickup = problem.requests[waiting.pool[0]].source
        if ahead_s is None or waiting.slot.station_id == pickup:
            return
        if self._drones[number].free_ms > now_ms + _PREPARE_MS:
            return
        oldest_s = min(problem.requests[each].known_s for each in waiting.pool)
        latest_ms = 1000 * (oldest_s + self.policy.most_wait_s - ahead_s)
        flight = self._empty_flight(problem, number, pickup, now_ms)
        if flight is not None and flight.end.at_ms + _TICK_MS > latest_ms:
            self._fly(number, flight, now_ms)
            self.flights_ahead += 1

    def _begins_early(self, problem: FleetProblem, number: int, trip: PlannedTrip) -> bool:
        """Whether a trip with a window delivers as soon if its drone sets out a minute later."""
        requests = tuple(problem.requests[each] for each in trip.pool)
        if not any(each.has_windows for each in requests):
            return False
        free_s = (trip.slot.at_ms + _TICK_MS) / 1000
        later = problem.drones[number].model_copy(update={"free_s": free_s})
        alone = problem.model_copy(update={"drones": (later,), "requests": requests})
        found = [each.trip.delivered_ms for each in Scheduler(alone).arrival_order().trips]
        return found == [trip.delivered_ms]

    def _empty_flight(
        self, problem: FleetProblem, number: int, end: StationId, now_ms: int
    ) -> PlannedTrip | None:
        """The flight of a drone without packages; None if no plan exists."""
        start = self._drone(number, now_ms)
        nothing = PackageToDeliver(package_id=PackageId("nothing"), mass_kg=0.0, destination=end)
        request = FleetRequest(
            request_id="empty flight", source=start.station_id, packages=(nothing,)
        )
        alone = problem.model_copy(
            update={
                "drones": (start,),
                "requests": (request,),
                "loading_s": 0.0,
                "dropoff_s": 0.0,
                "pad_reservations": self._reservations(now_ms),
            }
        )
        return next((each.trip for each in Scheduler(alone).arrival_order().trips), None)

    def _charge(self, until_ms: int) -> None:
        """Charge the drones that stand and wait, up to this moment."""
        self._pads = [
            each for each in self._pads if each.end_ms > until_ms - 2 * _TICK_MS - PAD_GAP_MS
        ]
        taken: set[StationId] = set()
        for state in sorted(self._drones, key=lambda each: each.free_ms):
            if state.charged_ms >= until_ms:
                continue
            is_taken = state.station_id in taken or any(
                each.station_id == state.station_id
                and each.start_ms - PAD_GAP_MS < until_ms
                and state.charged_ms < each.end_ms + PAD_GAP_MS
                for each in self._pads
            )
            if not is_taken and state.soc < MODEL.top_soc:
                taken.add(state.station_id)
                state.soc = soc_after_recharge(
                    MODEL, state.soc, (until_ms - state.charged_ms) / 1000
                )
            state.charged_ms = until_ms


def on_time_share(case: FleetCase, waited_s: Mapping[int, float]) -> float:
    """The share of requests that are served before they are due."""
    in_time = [each <= case.granted_s[number] for number, each in waited_s.items()]
    return sum(in_time) / len(case.granted_s)
