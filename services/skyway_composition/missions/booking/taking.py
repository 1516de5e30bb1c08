"""Taking what an offer needs: the world it was made in, its drones, and the stations of its pads.

All rows that could be contended are locked in the same order by everybody: delivery, network,
drones, missions, stations.
"""

from skyway.ids import DroneId
from skyway.runtime.sql.database import Tx
from skyway_composition.links.link import InstructionPlace
from skyway_composition.links.store import claim_next_place
from skyway_composition.missions.booking.store import take_at_once
from skyway_composition.pads.store import lock_stations
from skyway_composition.planning.offer import Offer
from skyway_composition.planning.world import World, still_holds


class Outdated(Exception):
    """The world changed while offers were made: plan anew."""


async def take(tx: Tx, offer: Offer, world: World) -> dict[DroneId, InstructionPlace]:
    """By drone the place of its mission's instruction; all is locked until the block ends.

    Raises
    ------
    Outdated
        Something was published, closed or lifted since the world was looked at (I11).
    """
    drones = sorted((part.candidate for part in offer.parts), key=lambda each: each.drone_id)
    booked = [pad for part in offer.parts for pad in part.trip.booked_pads]
    if tx.dialect == "postgresql" and len(drones) == 1:
        first = drones[0]
        place = await take_at_once(
            tx,
            world.present,
            first.drone_id,
            first.provider_id,
            station_ids=[each.station_id for each in booked],
        )
        if place is not None:
            return {first.drone_id: place}
    if not await still_holds(tx, world):
        raise Outdated
    places = {
        each.drone_id: await claim_next_place(tx, each.drone_id, each.provider_id)
        for each in drones
    }
    await lock_stations(tx, booked)
    return places
