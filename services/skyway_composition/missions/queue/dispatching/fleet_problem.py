"""Describes a fleet for the search of `skyway.dispatch`.

The search only proposes an order. So this description may leave out what plans need besides: the
standbys that are planned anew, that a drone may use the pads of its own standby, and the weather.
"""

from collections.abc import Collection, Iterable, Iterator
from datetime import datetime
from typing import Any, Final

from skyway.delivery.plan import Fly
from skyway.dispatch.problem import CurrentTrip, FleetDrone, FleetRequest, Prices
from skyway.ids import MissionId, PackageId, ProviderId, StationId
from skyway.planner.pad_book import OPEN_MS
from skyway.planner.problem_parts import PadReservation
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.queue.dispatching.fleet import Fleet, Moments
from skyway_composition.missions.queue.dispatching.merger import MOST_SHARES
from skyway_composition.missions.queue.dispatching.plan_orders import (
    ENERGY_S_PER_KWH,
    MOVE_S,
)
from skyway_composition.missions.queue.plan_queue import latest_ms
from skyway_composition.pads.store import PadHeldBy
from skyway_composition.planning.problem_for import Standing, to_load, with_margins
from skyway_composition.planning.world import World

#: The most labels of the search for one trip. Our own choice: a trip that needs more is seldom the
#: best one, and the search has little time.
_MOST_LABELS: Final = 20_000


def fleet_problem(
    fleet: Fleet,
    world: World,
    *,
    held: Iterable[PadHeldBy],
    times: Moments,
    tolerance_s: float,
    may_merge: Collection[MissionId] = (),
) -> dict[str, Any]:  # the fields of `FleetProblem`, without the network
    """The fields of the fleet's problem, whose second 0 is the moment from which missions may move.

    `held` are all reservations of the network. The missions of `may_merge` may share trips.
    """
    settings, base_ms = world.skyway.settings, times.settled_ms
    waiting, later_s = fleet.waiting, _later_in_still_air_s(fleet)
    # The problem has one time for all hand-overs: the longest.
    dropoff_s = settings.hand_over_s(one for each in waiting for one in each.request.packages)
    slots = [
        (each, slot)
        for each in fleet.calendars.values()
        if (slot := each.slot(not_before_ms=0, times=times)) is not None
    ]
    return {
        "start_at": ms_to_moment(base_ms),
        "drones": tuple(
            FleetDrone(
                drone_id=each.drone_id,
                provider_id=each.candidate.provider_id,
                model=with_margins(
                    world.for_drone(each.candidate.learned),
                    Standing(each.candidate.planned_model, slot.soc, slot.station_id),
                ).model,
                station_id=slot.station_id,
                free_s=(slot.at_ms - base_ms) / 1000,
                soc=slot.soc,
            )
            for each, slot in slots
        ),
        "requests": tuple(
            _request(
                each,
                number,
                base_ms=base_ms,
                age_s=float(len(waiting) - number),
                tolerance_s=tolerance_s,
                later_s=later_s[each.mission_id],
                spare_s=dropoff_s - settings.hand_over_s(each.request.packages),
                pooling=each.mission_id in may_merge,
                # A mission that may share a trip stays with its provider.
                provider_ids=(each.mission.provider_id,)
                if each.mission_id in may_merge
                else fleet.providers_of(each, network=world.skyway.network),
            )
            for number, each in enumerate(waiting)
        ),
        "pad_reservations": tuple(_reservations(fleet, world, held, times=times)),
        "closures": world.conditions.problem_closures(base_ms),
        "loading_s": settings.loading_s,
        "dropoff_s": dropoff_s,
        "hand_over_s": times.hand_over_ms / 1000,
        "pad_gap_s": settings.pad_gap_s,
        "prices": Prices(move_s=MOVE_S, energy_s_per_kwh=ENERGY_S_PER_KWH),
        "promise_tolerance_s": 0.0,
        "most_pooled": MOST_SHARES if may_merge else 1,
        "baseline": "current plan",
        "label_limit": _MOST_LABELS,
    }


def _request(
    record: MissionRecord,
    number: int,
    *,
    base_ms: int,
    age_s: float,
    tolerance_s: float,
    later_s: float,
    spare_s: float,
    pooling: bool,
    provider_ids: tuple[ProviderId, ...],
) -> FleetRequest:
    """A waiting mission as a request; requests that were booked earlier have a higher age.

    Its promise is `later_s` later than the customer's. Its hand-overs are `spare_s` shorter than
    those of the problem, so that they may end so much later there.
    """

    def seconds(moment: datetime | None, *, later_s: float = 0.0) -> float | None:
        return None if moment is None else (moment_to_ms(moment) - base_ms) / 1000 + later_s

    asked, latest = record.request, latest_ms(record, tolerance_s=tolerance_s)
    return FleetRequest(
        request_id=record.mission_id,
        source=asked.pickup.station_id,
        packages=tuple(
            to_load(each, start_ms=base_ms).model_copy(
                update={
                    "package_id": PackageId(f"{number}_{place}"),
                    "latest_s": seconds(each.latest_at, later_s=spare_s),
                }
            )
            for place, each in enumerate(asked.packages)
        ),
        known_s=-age_s,
        pickup_not_before_s=seconds(asked.earliest_pickup_at),
        pickup_latest_s=seconds(asked.latest_pickup_at),
        deadline_s=seconds(asked.qos.deadline_at),
        # The end of the tolerance, so that the search needs no tolerance of its own.
        promised_s=(max(latest.values()) - base_ms) / 1000 + later_s if latest else None,
        pooling=pooling,
        provider_ids=provider_ids,
        weight=asked.weight,
        planned=CurrentTrip(
            drone_id=record.drone_id, start_s=(record.start.at_ms - base_ms) / 1000
        ),
    )


def _later_in_still_air_s(fleet: Fleet) -> dict[MissionId, float]:
    """How much later each waiting mission would deliver without the tail winds of its plan.

    The search plans in still air. Without this span it would count promises as broken that the
    present plans keep with a tail wind, and find no order.
    """
    found: dict[MissionId, float] = {}
    for calendar in fleet.calendars.values():
        later_s = 0.0
        for each in calendar.waiting:
            flights = (step for step in each.mission.plan.steps if isinstance(step, Fly))
            saved_s = sum((one.end_s - one.start_s) * (1 / one.time_factor - 1) for one in flights)
            later_s += max(0.0, saved_s)
            found[each.mission_id] = later_s
    return found


def _reservations(
    fleet: Fleet, world: World, held: Iterable[PadHeldBy], *, times: Moments
) -> Iterator[PadReservation]:
    """The pads that do not move: without the gap after them, which the search adds itself."""
    moving = {each.mission_id for each in fleet.waiting}
    network, base_ms = world.skyway.network, times.settled_ms
    gap_ms = round(world.skyway.settings.pad_gap_s * 1000)
    for station_id, pad, start_ms, end_ms, owner in held:
        row = network.row_of.get(station_id)
        from_ms, until_ms = max(start_ms, base_ms), end_ms - gap_ms
        if row is None or owner in moving or pad >= network.columns.pads[row]:
            continue
        if from_ms < until_ms:
            yield _reservation(station_id, pad, from_ms, until_ms, base_ms)
    for station_id, pad, start_ms, end_ms in world.conditions.pad_outages(base_ms):
        yield _reservation(station_id, pad, max(start_ms, base_ms), end_ms, base_ms)


def _reservation(
    station_id: StationId, pad: int, start_ms: int, end_ms: int, base_ms: int
) -> PadReservation:
    return PadReservation(
        station_id=station_id,
        pad=pad,
        start_s=(start_ms - base_ms) / 1000,
        end_s=None if end_ms >= OPEN_MS else (end_ms - base_ms) / 1000,
    )
