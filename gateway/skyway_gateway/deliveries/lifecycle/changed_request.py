"""What becomes of a delivery whose customer changes its request, while no drone has its mission."""

from collections.abc import Mapping
from datetime import datetime

from skyway.contracts.mission import OfferLimits
from skyway.delivery.request import DeliveryRequest
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, Flags, PackageStatus
from skyway_gateway.deliveries.lifecycle.progress import changed, with_packages


def with_changed_request(
    delivery: Delivery,
    request: DeliveryRequest,
    *,
    offer: OfferLimits | None,
    is_ahead: bool,
    at: datetime,
) -> Delivery:
    """The delivery with another request: it is booked anew, in its old place in the queue.

    Composition has given up its missions. `offer` has the promise for the new request, by the
    tariff that was accepted. It is SCHEDULED if its pickup `is_ahead` of the booking horizon.
    """
    asked = {each.package_id: each for each in request.packages}

    def wait(package: PackageStatus) -> Mapping[str, object]:
        new = asked[package.package_id]
        return {
            "destination": new.destination,
            "mass_kg": new.mass_kg,
            "mission_id": None,
            "promised_at": None,
            "promised_p90_at": None,
            "due_at": None,
            "eta_at": None,
        }

    after = with_packages(delivery, wait, where=lambda one: one.state == "CREATED")
    after = changed(after, request=request, offer=offer, updated_at=at)
    if delivery.state == "SCHEDULED":
        return after
    missions = tuple(
        each.model_copy(update={"state": "REFUSED"}) if each.is_live else each
        for each in delivery.missions
    )
    return changed(
        after,
        state="SCHEDULED" if is_ahead else "REQUESTED",
        flags=Flags(),
        attempt=delivery.attempt + 1,
        missions=missions,
        price=None,
        provider_id=None,
        # Drones may have refused what was asked for before.
        refusals=(),
        reasons=(),
    )
