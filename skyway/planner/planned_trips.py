"""The result of `compose_many`: a row for each trip, and the plan of a trip on request."""

import math
from dataclasses import dataclass
from datetime import timedelta
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from skyway.delivery.plan import Plan, PlanStatus
from skyway.ids import PackageId
from skyway.planner.compose import compose, flyable
from skyway.planner.exact_acts import Act, acts_of
from skyway.planner.exact_itinerary import itinerary_of
from skyway.planner.kernels import trips as kernel
from skyway.planner.kernels.memory import Flags, Floats, Ints, Longs
from skyway.planner.kernels.records import Found
from skyway.planner.pad_book import OPEN_MS, PadBook
from skyway.planner.problem import DroneAtStart, PackageToDeliver, Problem
from skyway.planner.situation import Situation
from skyway.planner.trips import Trips
from skyway.planner.verify import PlanRejected, verify

if TYPE_CHECKING:
    from skyway.planner.pad_ledger import PadLedger

#: Acts and sessions of a short trip; the arrays grow if that is not enough.
_ACTS_PER_TRIP = 16
_SESSIONS_PER_TRIP = 4

#: Before all reservations, milliseconds.
_LONG_AGO_MS = -OPEN_MS


class TripOutcome(IntEnum):
    """The outcome of a trip, in `PlannedTrips.outcome`.

    PROVEN: the earliest plan. FEASIBLE: a plan, but the labels were used up before the proof.
    UNKNOWN: the labels were used up before a plan was found. NO_PLAN: a proof that no plan exists,
    for lack of range, pads or time. OVERWEIGHT: the drone cannot lift the packages. UNREACHABLE: no
    path leads to a place, or a place is closed for good. `PlannedTrips.plan` gives the detail.
    """

    PROVEN = kernel.PROVEN
    FEASIBLE = kernel.FEASIBLE
    UNKNOWN = kernel.UNKNOWN
    NO_PLAN = kernel.NO_PLAN
    OVERWEIGHT = kernel.OVERWEIGHT
    UNREACHABLE = kernel.UNREACHABLE


def new_found(trips: Trips) -> Found:
    """Empty columns for the results of these trips."""
    count, packages = len(trips), len(trips.destination_row)
    acts, sessions = _ACTS_PER_TRIP * count + 64, _SESSIONS_PER_TRIP * count + 64
    return Found(
        counts=np.zeros(3, np.int64),
        outcome=np.empty(count, np.int64),
        end_row=np.empty(count, np.int64),
        labels=np.zeros(count, np.int64),
        end_s=np.full(count, np.inf),
        left_j=np.full(count, np.nan),
        used_j=np.full(count, np.nan),
        act_offsets=np.zeros(count + 1, np.int64),
        session_offsets=np.zeros(count + 1, np.int64),
        delivered_s=np.full(packages, np.inf),
        act_link=np.empty((acts, 2), np.int64),
        act_value=np.empty((acts, 2)),
        session=np.empty((sessions, 4), np.int64),
    )


def with_room(found: Found) -> Found:
    """The same results with twice the room for acts and sessions."""
    larger = {
        name: np.concatenate([getattr(found, name), np.empty_like(getattr(found, name))])
        for name in ("act_link", "act_value", "session")
    }
    return found._replace(**larger)


@dataclass(frozen=True, slots=True, eq=False)
class PlannedTrips:
    """The result of `compose_many`; columns by trip ``(n,)`` or by package ``(m,)``."""

    trips: Trips
    ledger: "PadLedger"
    found: Found

    @property
    def outcome(self) -> Longs:
        """The `TripOutcome` of each trip."""
        return self.found.outcome

    @property
    def is_planned(self) -> Flags:
        """Which trips have a plan."""
        return self.found.outcome <= TripOutcome.FEASIBLE

    @property
    def end_s(self) -> Floats:
        """The moment of each trip's last delivery; inf without a plan."""
        return self.found.end_s

    @property
    def end_row(self) -> Longs:
        """The station row of the last delivery; -1 without a plan."""
        return self.found.end_row

    @property
    def end_soc(self) -> Floats:
        """State of charge after the last delivery; nan without a plan."""
        models = self.ledger.terms.models
        battery_j = np.array([model.battery_j for model in models])
        left: Floats = self.found.left_j / battery_j[self.trips.model]
        return left

    @property
    def energy_j(self) -> Floats:
        """Joules of all flights of a trip; nan without a plan."""
        return self.found.used_j

    @property
    def delivered_s(self) -> Floats:
        """The moment at which each package is delivered; inf without a plan."""
        return self.found.delivered_s

    @property
    def labels(self) -> Longs:
        """Labels that the search of each trip made."""
        return self.found.labels

    def sessions(self, trip: int) -> Longs:
        """The pads that this trip holds ``(k, 4)``, for `PadLedger.reserve`.

        Each row is a station row, a pad, and the start and end of the session in milliseconds.
        """
        offsets = self.found.session_offsets
        return self.found.session[offsets[trip] : offsets[trip + 1]]

    def problem(self, trip: int) -> Problem:
        """The trip as a problem, whose seconds count from the trip's own start.

        Its packages are named by their number within the trip.
        """
        trips, terms = self.trips, self.ledger.terms
        ids, pattern = terms.network.columns.station_ids, terms.pattern
        start_s = float(trips.start_s[trip])
        packages = tuple(
            PackageToDeliver(
                package_id=PackageId(f"{number}"),
                mass_kg=float(trips.mass_kg[package]),
                destination=ids[trips.destination_row[package]],
                not_before_s=_limit_s(trips.not_before_s[package], start_s),
                latest_s=_limit_s(trips.latest_s[package], start_s),
            )
            for number, package in enumerate(
                range(trips.package_offsets[trip], trips.package_offsets[trip + 1])
            )
        )
        drone = DroneAtStart(
            model=terms.models[trips.model[trip]],
            soc=float(trips.soc[trip]),
            station_id=ids[trips.start_row[trip]],
        )
        start_at = pattern.start_at
        fields = {
            "start_at": None if start_at is None else start_at + timedelta(seconds=start_s),
            "drone": drone,
            "are_on_board": bool(trips.are_on_board[trip]),
            "source": ids[trips.source_row[trip]],
            "packages": packages,
            "closures": tuple(
                each.model_copy(
                    update={
                        "start_s": each.start_s - start_s,
                        "end_s": None if each.end_s is None else each.end_s - start_s,
                    }
                )
                for each in pattern.closures
            ),
            "latest_delivery_s": _limit_s(trips.latest_delivery_s[trip], start_s),
            "pickup_not_before_s": _limit_s(trips.pickup_not_before_s[trip], start_s),
            "pickup_latest_s": _limit_s(trips.pickup_latest_s[trip], start_s),
        }
        return pattern.model_copy(update=fields)

    def plan(self, trip: int) -> Plan:
        """The plan of this trip, verified against the current reservations of the ledger.

        Its seconds count from the trip's own start. The trip's own sessions may be reserved by now.
        If the trip has no plan, the reason is found with the current reservations.

        Raises
        ------
        PlanRejected
            Another trip has reserved a pad that this plan needs.
        """
        problem, terms = self.problem(trip), self.ledger.terms
        start_ms = round(1000 * float(self.trips.start_s[trip]))
        if self.outcome[trip] == TripOutcome.UNKNOWN:
            return Plan(status=PlanStatus.UNKNOWN)
        if not self.is_planned[trip]:
            booked = self.ledger.book()
            return compose(
                problem, airspace=terms.airspace, booked=booked.seen_from(booked.zero_ms + start_ms)
            )
        sessions = self.sessions(trip)
        # A full recharge needs one pad, and may end a rounding error after its session.
        slack_ms = 1 if problem.recharge_policy == "full" else 0
        own = _only(sessions, terms.network.columns.pads, slack_ms=slack_ms).seen_from(start_ms)
        situation = Situation.of(problem, terms.airspace, own)
        itinerary = itinerary_of(situation, self._acts(trip))
        is_proven = self.outcome[trip] == TripOutcome.PROVEN
        plan = flyable(
            itinerary,
            PlanStatus.OPTIMAL if is_proven else PlanStatus.FEASIBLE,
            itinerary.delivered_s if is_proven else None,
        ).model_copy(update={"stats": {"strategy": "exact", "labels": int(self.labels[trip])}})
        others = self.ledger.book(sessions[:, 0].tolist()).without(sessions)
        violations = verify(problem, plan, booked=others.seen_from(others.zero_ms + start_ms))
        if violations:
            raise PlanRejected(violations)
        return plan

    def _acts(self, trip: int) -> list[Act]:
        part = slice(self.found.act_offsets[trip], self.found.act_offsets[trip + 1])
        links, values = self.found.act_link[part], self.found.act_value[part]
        start_s = float(self.trips.start_s[trip])
        return acts_of(links[:, 0], links[:, 1], values[:, 0], values[:, 1] - start_s)


def _limit_s(moment_s: float, start_s: float) -> float | None:
    return float(moment_s) - start_s if math.isfinite(moment_s) else None


def _only(sessions: Longs, pads: Ints, *, slack_ms: int) -> PadBook:
    """A book in which the pads of these stations are free only during these sessions.

    The pads stay free for `slack_ms` after each session.
    """
    taken = []
    for row in sorted(set(sessions[:, 0].tolist())):
        for pad in range(pads[row]):
            own = sessions[(sessions[:, 0] == row) & (sessions[:, 1] == pad), 2:]
            free_from_ms = _LONG_AGO_MS
            for from_ms, until_ms in sorted(own.tolist()):
                taken.append((row, pad, min(free_from_ms, from_ms), from_ms))
                free_from_ms = until_ms + slack_ms
            taken.append((row, pad, free_from_ms, OPEN_MS))
    columns = np.array(taken, np.int64).reshape(-1, 4).T
    return PadBook.of_arrays(
        station=columns[0], pad=columns[1], start_ms=columns[2], end_ms=columns[3]
    )
