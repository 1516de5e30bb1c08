"""A delivery request as customers send it: the internal request holds stations, and no places."""

from collections.abc import Callable, Iterator
from typing import Annotated, Final, Self

from pydantic import Field, field_validator, model_validator

from skyway.delivery.qos import FURTHEST_PICKUP_M
from skyway.delivery.request import DeliveryRequest, Package, PackageTo, Place, RequestFor
from skyway.delivery.verification import PlannedVerification
from skyway.geo import Position
from skyway.ids import StationId
from skyway.json_model import JsonModel

#: How far a station may be if the customer does not say: a walk of 12 minutes. Our own choice.
DEFAULT_WALK_M: Final = 1_000.0

WalkLimit = Annotated[
    float,
    Field(
        gt=0,
        le=FURTHEST_PICKUP_M,
        description="The furthest station that may serve the place, metres in a straight line, up "
        "to 5000; 1000 if null.",
    ),
]
Latitude = Annotated[float, Field(ge=-180, le=180, description="Degrees north, -90 to 90.")]
Longitude = Annotated[float, Field(ge=-180, le=180, description="Degrees east, -180 to 180.")]
PlusCode = Annotated[
    str,
    Field(
        min_length=2,
        max_length=200,
        description="An Open Location Code of at least 8 digits: a full one, or a short one and a "
        "reference place, such as `V3M5+88 San Marcos`.",
    ),
]
Address = Annotated[
    str,
    Field(
        min_length=2,
        max_length=300,
        description="An address for the geocoder. Without a geocoder of your own: the name of a "
        "station or of a town of the bundled network.",
    ),
]


class Location(JsonModel):
    """A point on the map."""

    latitude: Latitude
    longitude: Longitude

    @model_validator(mode="after")
    def _lies_on_earth(self) -> Self:
        if abs(self.latitude) > 90:
            swapped = ": latitude and longitude look swapped" if abs(self.longitude) <= 90 else ""
            raise ValueError(f"latitude {self.latitude:g} is not within -90 and 90{swapped}")
        return self

    @property
    def position(self) -> Position:
        """The same in the order of GeoJSON."""
        return Position(self.longitude, self.latitude)


class CustomerPlace(JsonModel):
    """Where something is picked up or handed over: a station, or a place that a station serves.

    Exactly one of `station_id`, `location`, `plus_code` and `address` is given.
    """

    station_id: StationId | None = None
    location: Annotated[
        Location | None, Field(description="A point; a station near it serves it.")
    ] = None
    plus_code: PlusCode | None = None
    address: Address | None = None
    max_walk_m: WalkLimit | None = None

    @field_validator("plus_code", "address")
    @classmethod
    def _is_one_line(cls, text: str | None) -> str | None:
        if text is not None and not (text.isprintable() and text.strip()):
            raise ValueError("must be one line of visible characters")
        return text

    @model_validator(mode="after")
    def _names_one_place(self) -> Self:
        given = [name for name in _WAYS if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none of them"
            raise ValueError(f"needs exactly one of {', '.join(_WAYS)}; it has {found}")
        if self.max_walk_m is not None and self.station_id is not None:
            raise ValueError("max_walk_m is for places that are no stations; leave it out")
        return self

    @property
    def way(self) -> str:
        """The field that names the place."""
        return next(name for name in _WAYS if getattr(self, name) is not None)

    @property
    def walk_limit_m(self) -> float:
        """How far a station may be that serves the place."""
        return self.max_walk_m or DEFAULT_WALK_M


#: The ways to name a place.
_WAYS: Final = ("station_id", "location", "plus_code", "address")

#: The station that serves a place.
ServedBy = Callable[[CustomerPlace], StationId]


class CustomerPackage(PackageTo[CustomerPlace]):
    """What is carried; its id is the customer's and unique within the request.

    With nobody at the destination it goes to the `alternative`, or back to the pickup. The window
    from `not_before_at` to `latest_at` holds the whole hand-over at the destination.
    """

    def at_stations(self, served_by: ServedBy, alternative_by: ServedBy) -> Package:
        """The package with the stations that serve its places."""
        other, asked = self.alternative, self.dropoff_verification
        return Package(
            destination=Place(station_id=served_by(self.destination)),
            alternative=None if other is None else Place(station_id=alternative_by(other)),
            # A customer's form may hold a PIN, which goes no further.
            dropoff_verification=asked
            and PlannedVerification(method=asked.method, wait_s=asked.wait_s),
            **{name: getattr(self, name) for name in _OF_PACKAGE},
        )


class CustomerRequest(RequestFor[CustomerPlace, CustomerPackage]):
    """What a customer asks for: packages, their destinations and the QoS."""

    def at_stations(self, served_by: ServedBy, alternative_by: ServedBy) -> DeliveryRequest:
        """The internal request, with the stations that serve the places."""
        return DeliveryRequest(
            pickup=Place(station_id=served_by(self.pickup)),
            packages=tuple(each.at_stations(served_by, alternative_by) for each in self.packages),
            **{name: getattr(self, name) for name in _OF_REQUEST},
        )

    def places(self) -> Iterator[tuple[str, CustomerPlace]]:
        """All places, each with its field: the pickup, destinations, and alternatives."""
        yield "pickup", self.pickup
        for number, package in enumerate(self.packages):
            yield f"packages.{number}.destination", package.destination
            if package.alternative is not None:
                yield f"packages.{number}.alternative", package.alternative


#: The fields that both forms have in the same form.
_OF_PACKAGE: Final = tuple(
    PackageTo.model_fields.keys() - {"destination", "alternative", "dropoff_verification"}
)
_OF_REQUEST: Final = tuple(RequestFor.model_fields.keys() - {"pickup", "packages"})
