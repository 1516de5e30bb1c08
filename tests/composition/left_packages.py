"""What is left to book of a delivery in a busy world."""

from skyway_composition.missions.mission.custody_store import has_never_left, held_packages
from skyway_composition.missions.mission.share_views import own_ids, serves

from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId
from tests.composition.busy_world import BusyWorld


async def left_to_book(world: BusyWorld, delivery_id: str) -> DeliveryRequest | None:
    """The packages of a delivery that are at the pickup and in no mission that is not over."""
    live = await world.planned()
    request = world.requests[delivery_id]
    async with world.db.read() as connection:
        held = await held_packages(connection, DeliveryId(delivery_id))
    under_way = {
        package_id
        for one in live
        if serves(one, DeliveryId(delivery_id))
        for package_id in own_ids(
            one, DeliveryId(delivery_id), [each.package_id for each in one.request.packages]
        )
    }
    left = tuple(
        each
        for each in request.packages
        if each.package_id not in under_way
        and (delivery_id, each.package_id) not in world.released
        and has_never_left(held.get(each.package_id))
    )
    return request.model_copy(update={"packages": left}) if left else None
