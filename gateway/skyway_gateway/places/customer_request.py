"""A delivery request as customers send it: the internal request holds no personal data of it."""

from collections.abc import Callable
from typing import Final

from skyway.delivery.request import DeliveryRequest, Package, PackageTo, Place, RequestFor
from skyway.ids import StationId
from skyway.json_model import JsonModel


class CustomerPlace(JsonModel):
    """Where something is picked up or handed over."""

    station_id: StationId


def named_station(place: CustomerPlace) -> Place:
    """The station that a customer names."""
    return Place(station_id=place.station_id)


class CustomerPackage(PackageTo[CustomerPlace]):
    """What is carried; its id is the customer's and unique within the request.

    With nobody at the destination it goes to the `alternative`, or back to the pickup. The window
    from `not_before_at` to `latest_at` holds the whole hand-over at the destination.
    """

    def at_stations(self, served_by: Callable[[CustomerPlace], Place]) -> Package:
        """The package with the stations that serve its places."""
        return Package(
            destination=served_by(self.destination),
            alternative=None if self.alternative is None else served_by(self.alternative),
            **{name: getattr(self, name) for name in _OF_PACKAGE},
        )


class CustomerRequest(RequestFor[CustomerPlace, CustomerPackage]):
    """What a customer asks for: packages, their destinations and the QoS."""

    def at_stations(self, served_by: Callable[[CustomerPlace], Place]) -> DeliveryRequest:
        """The internal request, with the stations that serve the places."""
        return DeliveryRequest(
            pickup=served_by(self.pickup),
            packages=tuple(package.at_stations(served_by) for package in self.packages),
            **{name: getattr(self, name) for name in _OF_REQUEST},
        )


#: The fields that both forms have and that name no place.
_OF_PACKAGE: Final = tuple(PackageTo.model_fields.keys() - {"destination", "alternative"})
_OF_REQUEST: Final = tuple(RequestFor.model_fields.keys() - {"pickup", "packages"})
