"""What one booking attempt asks for: the packages that wait, within the promised limits."""

from skyway.contracts.candidate import CandidateQuery
from skyway.contracts.mission import BookMissions, OfferLimits
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import Price
from skyway.delivery.request import DeliveryRequest, ProviderChoice
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.records.stored_delivery import QueuedDelivery


def candidate_query(queued: QueuedDelivery) -> CandidateQuery:
    """The question to the registry; for an accepted offer only its provider is asked."""
    delivery = queued.delivery
    choice = delivery.request.qos.providers
    if delivery.offer is not None:
        choice = ProviderChoice(pinned=delivery.offer.provider_id)
    masses_kg = [package.mass_kg for package in delivery.waiting]
    return CandidateQuery(
        pickup_station_id=delivery.request.pickup.station_id,
        pickup_position=queued.pickup_position,
        payload_kg=sum(masses_kg),
        heaviest_kg=max(masses_kg, default=0.0),
        providers=choice,
        excluded_drone_ids=tuple(refusal.drone_id for refusal in delivery.refusals),
    )


def booking_request(delivery: Delivery, shortlist: Shortlist) -> BookMissions:
    """The question to composition."""
    return BookMissions(
        attempt=delivery.attempt,
        request=_request(delivery),
        shortlist=shortlist,
        offer=_limits(delivery),
    )


def _request(delivery: Delivery) -> DeliveryRequest:
    """The request with only the packages that wait, and the remaining price limit."""
    waiting = {package.package_id for package in delivery.waiting}
    request = delivery.request
    packages = tuple(one for one in request.packages if one.package_id in waiting)
    qos = request.qos
    if qos.max_price is not None:
        max_price = max(0, qos.max_price - _booked_amount(delivery))
        qos = qos.model_copy(update={"max_price": max_price})
    return request.model_copy(update={"packages": packages, "qos": qos})


def _limits(delivery: Delivery) -> OfferLimits | None:
    """The limits of an accepted offer, less the price of trips that are booked already."""
    offer = delivery.offer
    if offer is None:
        return None
    amount = max(0, offer.price.amount - _booked_amount(delivery))
    price = Price(amount=amount, currency=offer.price.currency)
    return offer.model_copy(update={"price": price})


def _booked_amount(delivery: Delivery) -> int:
    """The price of the booked missions, without those that were cancelled."""
    booked = (mission for mission in delivery.missions if mission.state != "CANCELLED")
    return sum(mission.price.amount for mission in booked)
