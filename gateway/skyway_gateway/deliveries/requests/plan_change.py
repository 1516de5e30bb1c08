"""Plans a change of a request: what it becomes, whether it is possible, and what it would cost."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from skyway.contracts.mission import OfferLimits
from skyway.delivery.request import DeliveryRequest
from skyway.errors import InvalidInput
from skyway.ids import PackageId
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.requests.change_form import DeliveryChange, changed_members
from skyway_gateway.places.serve import PlaceServer
from skyway_gateway.places.served import ServedPlace
from skyway_gateway.quotes.make_quote import Offers, QuoteMaker
from skyway_gateway.quotes.store import Offer


@dataclass(frozen=True, slots=True)
class PlannedChange:
    """The request of a delivery after a change; the same if only people and words change.

    `offer` is what an accepted offer promises for it, and `preview` is the best offer, if it was
    asked for. `places` are those that the change names.
    """

    before: Delivery
    request: DeliveryRequest
    offer: OfferLimits | None
    places: tuple[ServedPlace, ...] = ()
    preview: Offer | None = None
    names: tuple[str, ...] = field(default=())

    def places_after(self, before: tuple[ServedPlace, ...]) -> tuple[ServedPlace, ...]:
        """The places of the request, of which those whose station has changed are gone."""
        left = (_still_named(each, self) for each in before)
        return (*(each for each in left if each is not None), *self.places)


@dataclass(frozen=True, slots=True)
class ChangePlanner:
    """Plans changes of requests."""

    places: PlaceServer
    quotes: QuoteMaker

    async def plan(
        self, caller: Caller, delivery: Delivery, requested: DeliveryChange
    ) -> PlannedChange:
        """The request after the change, checked like a new one.

        An accepted offer is promised anew: by the same provider and tariff. A dry run shows the
        best offer of the providers that may serve it.

        Raises
        ------
        InvalidInput
            A member is impossible, or does not fit those that stay.
        Conflict
            NO_OFFER: the provider of the accepted offer cannot fly the changed request.
        """
        try:
            return await self._plan(caller, delivery, requested)
        except InvalidInput as fault:
            raise requested.in_own_words(fault, delivery.request) from fault

    async def _plan(
        self, caller: Caller, delivery: Delivery, requested: DeliveryChange
    ) -> PlannedChange:
        asked = requested.asked_after(delivery.request)
        if asked is None:
            return PlannedChange(delivery, delivery.request, delivery.offer)
        served = await self.places.serve(asked, who=str(caller))
        request = served.nearest
        names = tuple(changed_members(delivery.request, request))
        if not names:
            return PlannedChange(delivery, delivery.request, delivery.offer, served.places)
        _require_moment(delivery, request)
        best, limits = None, delivery.offer
        if requested.dry_run or limits is not None:
            waiting = _waiting_part(delivery, request)
            found = await self.quotes.offers(caller, waiting, kept=limits)
            best = found.offers[0] if found.offers else None
            if limits is not None:
                limits = _best(found, limits).limits(None)
        else:
            await self.quotes.checks.check(request)
        return PlannedChange(delivery, request, limits, served.places, best, names)


def _require_moment(delivery: Delivery, request: DeliveryRequest) -> None:
    if delivery.state == "SCHEDULED" and request.first_hand_over_at is None:
        detail = "must be a moment, such as now: no other time says when to find a drone"
        raise InvalidInput("earliest_pickup_at", detail)


def _waiting_part(delivery: Delivery, request: DeliveryRequest) -> DeliveryRequest:
    """The request without packages that were cancelled, from where they are."""
    left = {each.package_id for each in delivery.packages if not each.is_settled}
    packages = tuple(each for each in request.packages if each.package_id in left)
    return request.model_copy(update={"packages": packages, "pickup": delivery.pickup})


def _best(found: Offers, accepted: OfferLimits) -> Offer:
    if found.offers:
        return found.offers[0]
    reasons = "; ".join(f"{each.code}, {each.detail}" for each in found.infeasible)
    detail = f"{accepted.provider_id} cannot fly the changed request: {reasons}"
    members = {"reasons": [each.model_dump(mode="json") for each in found.infeasible]}
    raise Conflict("NO_OFFER", detail, members=members)


def _still_named(place: ServedPlace, change: PlannedChange) -> ServedPlace | None:
    """A place with the fields whose station the change leaves; None if there are none left."""
    moved = {*change.names}
    numbers = {each.package_id: number for number, each in enumerate(change.request.packages)}
    gone = {*_fields(moved, numbers)}
    fields = tuple(each for each in place.fields if each not in gone)
    return place.model_copy(update={"fields": fields}) if fields else None


def _fields(names: set[str], numbers: dict[PackageId, int]) -> Iterator[str]:
    """The fields of the request for names such as `packages.p1.destination`."""
    for name in names:
        start, _, rest = name.partition(".")
        package_id, _, member = rest.rpartition(".")
        if start == "packages":
            yield f"packages.{numbers[PackageId(package_id)]}.{member}"
