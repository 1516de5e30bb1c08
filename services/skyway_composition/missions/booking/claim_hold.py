"""Claims the drones and pads of offers that are to be held, in one transaction."""

from collections.abc import Sequence

from skyway.ids import HoldId
from skyway.runtime.sql.database import Tx
from skyway.scheduling.trip import BookedPad, merged, without
from skyway_composition.links.store import lock_link
from skyway_composition.missions.booking.engage import WorldChanged
from skyway_composition.missions.booking.held_offer import HeldOffer
from skyway_composition.missions.booking.hold_store import free_drones, free_pads, pads_of_drones
from skyway_composition.missions.booking.store import booked_missions
from skyway_composition.pads.store import lock_stations
from skyway_composition.planning.world import World, still_holds


async def claim_for_hold(
    tx: Tx,
    offers: Sequence[HeldOffer],
    world: World,
    *,
    now_ms: int,
    own_hold: HoldId | None = None,
) -> tuple[BookedPad, ...]:
    """Lock what these offers need; returns the pads to hold. What `own_hold` keeps is given up.

    Pads that a mission of the same drone has reserved are not held twice.

    Raises
    ------
    WorldChanged
        A network was published, a closure made or lifted, the calendar of a drone has changed
        since the offers were planned, or a drone is held at `now_ms`, fleet time.
    """
    if not await still_holds(tx, world):
        raise WorldChanged
    drones = {
        part.candidate.drone_id: part.candidate for held in offers for part in held.offer.parts
    }
    if own_hold is not None:
        await free_drones(tx, own_hold, before_locking=drones)
    for drone_id in sorted(drones):
        await lock_link(tx, drone_id, drones[drone_id].provider_id)
    now = await booked_missions(tx.connection, tuple(drones), now_ms=now_ms)
    if set(now) != {each for held in offers for each in held.calendars}:
        raise WorldChanged
    own_pads = await pads_of_drones(tx.connection, tuple(drones))
    pads = without(pads_of_offers(offers), own_pads)
    await lock_stations(tx, pads)
    if own_hold is not None:
        await free_pads(tx, own_hold)
    return pads


def pads_of_offers(offers: Sequence[HeldOffer]) -> tuple[BookedPad, ...]:
    """The pads of all trips of these offers."""
    return merged(
        pad for held in offers for part in held.offer.parts for pad in part.trip.booked_pads
    )
