"""Claims what an offer needs, and adds its missions, steps, custody and instructions."""

from collections.abc import Mapping, Sequence
from datetime import timedelta

from skyway.contracts.mission import Booking, Mission
from skyway.ids import DeliveryId, DroneId, HoldId, MissionId
from skyway.runtime.clock import FleetClock
from skyway.runtime.sql.database import Tx
from skyway.scheduling.trip import BookedPad, without
from skyway.units import moment_to_ms
from skyway_composition.calendar.commit import Snapshot, WorldChanged, lock_as_seen
from skyway_composition.calendar.store import raise_versions
from skyway_composition.context import Context
from skyway_composition.links.courier import Courier
from skyway_composition.links.link import InstructionPlace
from skyway_composition.links.store import claim_next_place
from skyway_composition.margins import HAND_OVER, PROOF_ARRIVES
from skyway_composition.missions.booking.clear_way import MovedStandby, move_standbys
from skyway_composition.missions.booking.hold_store import (
    drones_of_hold,
    free_drones,
    free_pads,
)
from skyway_composition.missions.booking.store import claim_in_one_statement, missions_of
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.custody_store import (
    begin_at_pickup,
    held_packages,
)
from skyway_composition.missions.mission.from_trip import StepTerms, flight_steps, new_mission
from skyway_composition.missions.mission.instruct import mission_draft
from skyway_composition.missions.mission.standby import end_standby_before, restore_pads
from skyway_composition.missions.mission.step_store import add_steps
from skyway_composition.missions.mission.unit_of_work import free_from, report_in
from skyway_composition.pads.store import give_way, lock_stations, pads_of_queued, reserve
from skyway_composition.planning.availability import send_ahead_ms
from skyway_composition.planning.offer import Offer, Part
from skyway_composition.planning.world import World


async def engage(
    context: Context,
    tx: Tx,
    offer: Offer,
    world: World,
    *,
    places: Mapping[DroneId, InstructionPlace],
    delivery_id: DeliveryId,
    attempt: int,
) -> tuple[Mission, ...]:
    """Add the missions of a claimed offer, and send them as instructions at these places.

    A mission without a place is QUEUED behind the drone's other missions, and not sent. The rows
    are added when the transaction ends. It then fails with `RowRefused` if another mission has one
    of the drones or pads.
    """
    skyway, courier, missions = world.skyway, Courier(context.clock, context.mint), []
    firm_within_s = offer.parts[0].request.qos.firm_within_s if attempt == 1 else 0.0
    firm_at = context.clock.now() + timedelta(seconds=firm_within_s) if firm_within_s else None
    expires_at = courier.expiry()
    held = await held_packages(tx.connection, delivery_id) if attempt > 1 else {}
    for number, part in enumerate(offer.parts, 1):
        place = places.get(part.candidate.drone_id)
        record = new_mission(
            part,
            world,
            delivery_id=delivery_id,
            attempt=attempt,
            trip_number=number,
            mission_id=MissionId(context.mint("msn")),
            expires_at=expires_at,
            planned_in=world.present if place is None else None,
            firm_at=firm_at,
        )
        if place is None:
            now, free = context.clock.now(), free_from(record)
            record = report_in(tx, context.mint, record, "QUEUED", at=now, free_from=free)
        terms = StepTerms.of(record, skyway.settings, proof_wait=PROOF_ARRIVES.span(context.clock))
        steps = flight_steps(skyway.network, [*part.trip.steps()], terms=terms, first_step=1)
        store.add(tx, record, next_end_ms=moment_to_ms(steps[0].planned_end_at))
        reserve(tx, {record.mission_id: await _needed_pads(tx, part)})
        package_ids = (each.package_id for each in record.request.packages)
        begin_at_pickup(tx, record, [each for each in package_ids if each not in held])
        add_steps(tx, record.mission_id, steps)
        if place is not None:
            draft = mission_draft(record.mission, steps)
            courier.post_last(tx, place, draft, expires_at=expires_at)
        missions.append(record.mission)
    return tuple(missions)


async def _needed_pads(tx: Tx, part: Part) -> Sequence[BookedPad]:
    """The pads of a trip; those that the drone's next mission holds already stay with it."""
    if part.opening is None or part.opening.before is None:
        return part.trip.booked_pads
    queued = await pads_of_queued(tx.connection, part.candidate.drone_id)
    return without(part.trip.booked_pads, queued)


async def claim(
    context: Context,
    tx: Tx,
    offer: Offer,
    world: World,
    *,
    calendars: Mapping[DroneId, int],
    own_hold: HoldId | None = None,
    moves: Sequence[MovedStandby] = (),
) -> dict[DroneId, InstructionPlace]:
    """Lock what an offer needs; returns the place of each drone's next instruction.

    A drone that begins later, or after another mission, gets no instruction yet, and is left out.
    The drones and pads of `own_hold` are freed for this booking. QUEUED missions of other drones
    get the standbys of `moves`.

    The locks on the network, the drones and the stations last until the transaction ends.

    Raises
    ------
    WorldChanged
        A network was published, or a closure made or lifted, since the world was read (I11), or
        the calendar of a drone has not the number of `calendars` or of its move.
    """
    now_ms, clock = context.now_ms, context.clock
    parts = sorted(offer.parts, key=lambda each: each.candidate.drone_id)
    providers = {each.candidate.drone_id: each.candidate.provider_id for each in parts}
    moving = {each.drone_id: each.calendar_version for each in moves}
    seen = Snapshot(world.present, moving | {each: calendars[each] for each in providers})
    booked = [pad for part in parts for pad in part.trip.booked_pads]
    sent_now = {
        each.candidate.drone_id
        for each in parts
        if _is_sent_now(each, now_ms + send_ahead_ms(clock, each.request.qos))
    }
    first = parts[0].candidate
    is_only_sent = first.drone_id in sent_now and parts[0].opening is None and own_hold is None
    is_only_sent = is_only_sent and not moves
    if tx.dialect == "postgresql" and len(parts) == 1 and is_only_sent:
        place = await claim_in_one_statement(
            tx,
            seen,
            first.drone_id,
            first.provider_id,
            station_ids=[each.station_id for each in booked],
            now_ms=now_ms,
        )
        if place is not None:
            return {first.drone_id: place}
    own = await drones_of_hold(tx, own_hold)
    await lock_as_seen(tx, seen, providers=providers, also=own)
    if own_hold is not None:
        await free_drones(tx, own_hold)
    places = {}
    for drone_id in sorted(sent_now):
        place = await claim_next_place(tx, drone_id, providers[drone_id], now_ms=now_ms)
        if place is None:
            raise WorldChanged([drone_id])
        places[drone_id] = place
    await raise_versions(tx, sorted(seen.calendars.keys() - sent_now))
    await lock_stations(tx, [*booked, *(pad for each in moves for pad in each.pads)])
    if own_hold is not None:
        await free_pads(tx, own_hold)
    await move_standbys(tx, moves, world)
    await _make_room(tx, parts, clock=clock)
    return places


def _is_sent_now(part: Part, send_by_ms: int) -> bool:
    """Whether the drone is idle and the mission begins soon."""
    is_idle = part.opening is None or part.opening.after is None
    return is_idle and part.trip.start_ms <= send_by_ms


async def _make_room(tx: Tx, parts: Sequence[Part], *, clock: FleetClock) -> None:
    """End the standbys after which these parts begin, and free the pads that they need."""
    for part in parts:
        after = None if part.opening is None else part.opening.after
        if after is None:
            continue
        await end_standby_before(tx, after, part.trip.start_ms - HAND_OVER.ms(clock))
        # The live mission may need pads of the standby that has just ended, but not those of the
        # new mission: it is the same drone.
        live = await restore_pads(tx, part.candidate.drone_id)
        before = {after} | (set() if live is None else {live.mission_id})
        for mission_id in sorted(before):
            await give_way(tx, mission_id, part.trip.booked_pads)


async def claim_delivery(
    tx: Tx, delivery_id: DeliveryId, attempt: int, *, exists: bool
) -> Booking | None:
    """Lock a delivery that has a row, or add it when the transaction ends.

    Returns the answer if the delivery is closed, or this attempt was booked or withdrawn before.
    """
    if not exists:
        # If another request books or closes it first, the database refuses this row.
        store.add_delivery(tx, delivery_id)
        return None
    delivery = await store.lock_delivery(tx, delivery_id)
    if delivery.is_closed:
        return Booking(outcome="CLOSED")
    if attempt <= delivery.withdrawn_attempt:
        return Booking(outcome="WITHDRAWN")
    booked = await missions_of(tx.connection, delivery_id, attempt=attempt)
    return Booking(outcome="BOOKED", missions=booked) if booked else None
