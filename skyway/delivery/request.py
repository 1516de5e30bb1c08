"""The delivery request: packages, places and windows; `skyway.delivery.qos` annotates it."""

from collections import Counter
from datetime import datetime, timedelta
from typing import Annotated, Final, Generic, TypeVar

from pydantic import Field, field_validator

from skyway.bounds import Moment
from skyway.delivery.qos import QoS
from skyway.delivery.verification import DropoffVerification, PlannedVerification
from skyway.drone.cargo import CargoNeeds
from skyway.ids import PackageId, StationId
from skyway.json_model import JsonModel

#: The most packages and the most distinct destinations of one request; more destinations than one
#: trip can take (the planner takes 12) are split over several.
MAX_PACKAGES = 100
MAX_DESTINATIONS = 48
MAX_TRIP_DESTINATIONS = 12

#: No package is heavier than the heaviest thing a drone model may lift; a typing mistake is.
MAX_PACKAGE_MASS_KG = 1_000.0

#: How much a second of a PRIORITY delivery counts, if one of a STANDARD delivery counts 1. Our own
#: choice.
_PRIORITY_WEIGHT: Final = 2.0

#: The same of a delivery whose packages may come at any moment of their windows, so that others
#: come earlier.
#: Our own choice.
WINDOW_WEIGHT: Final = 0.1


class Place(JsonModel):
    """Where something is picked up or handed over."""

    station_id: StationId


PlaceT = TypeVar("PlaceT", bound=JsonModel)


class PackageTo(CargoNeeds, Generic[PlaceT]):
    """A package whose places have this form."""

    package_id: PackageId
    # Strict: true is not 1 kg.
    mass_kg: Annotated[
        float,
        Field(ge=0, le=MAX_PACKAGE_MASS_KG, description="Mass in kilograms, 0 to 1000."),
    ]
    destination: Annotated[PlaceT, Field(description="Where it is handed over.")]
    alternative: Annotated[
        PlaceT | None,
        Field(description="Where it goes if nobody is at the destination; the pickup if null."),
    ] = None
    not_before_at: Annotated[
        Moment | None,
        Field(description="The hand-over does not begin before, RFC 3339 UTC, fleet time."),
    ] = None
    latest_at: Annotated[
        Moment | None,
        Field(description="The hand-over is over by then, RFC 3339 UTC, fleet time."),
    ] = None
    dropoff_verification: Annotated[
        DropoffVerification | None,
        Field(
            exclude_if=lambda value: value is None,
            description="The proof without which it is not handed over; null without one.",
        ),
    ] = None


class Package(PackageTo[Place]):
    """What is carried; its id is the customer's and unique within the request.

    With nobody at the destination it goes to the `alternative`, or back to the pickup. The window
    from `not_before_at` to `latest_at` holds the whole hand-over at the destination.
    """

    dropoff_verification: Annotated[
        PlannedVerification | None,
        Field(
            exclude_if=lambda value: value is None,
            description="The proof without which it is not handed over; null without one.",
        ),
    ] = None


PackageT = TypeVar("PackageT", bound=PackageTo)  # type: ignore[type-arg]  # of any place


class RequestFor(JsonModel, Generic[PlaceT, PackageT]):
    """A request whose places and packages have these forms."""

    pickup: Annotated[PlaceT, Field(description="Where all packages are picked up.")]
    # At least one is checked below: pydantic would count only those that are themselves valid.
    packages: Annotated[
        tuple[PackageT, ...],
        Field(
            max_length=MAX_PACKAGES,
            json_schema_extra={"minItems": 1},
            description="What is delivered, 1 to 100 packages.",
        ),
    ]
    qos: Annotated[
        QoS, Field(description="How offers are ranked, and the limits that they must keep.")
    ] = QoS()
    earliest_pickup_at: Annotated[
        Moment | None,
        Field(description="The drone does not begin to load before, RFC 3339 UTC, fleet time."),
    ] = None
    latest_pickup_at: Annotated[
        Moment | None,
        Field(
            description="Loading is over by then, RFC 3339 UTC, fleet time. Then the drone may "
            "set out for the pickup before `earliest_pickup_at`."
        ),
    ] = None
    reference: Annotated[
        Annotated[str, Field(max_length=200)] | None,
        Field(description="The customer's own word for it, up to 200 characters."),
    ] = None

    @field_validator("packages")
    @classmethod
    def _packages_are_some_and_distinct(
        cls, packages: tuple[PackageT, ...]
    ) -> tuple[PackageT, ...]:
        if not packages:
            raise ValueError("at least one package must be given")
        for package_id, times in Counter(package.package_id for package in packages).items():
            if times > 1:
                raise ValueError(f"package_id {package_id!r} is given {times} times")
        destinations = {package.destination for package in packages}
        if len(destinations) > MAX_DESTINATIONS:
            raise ValueError(
                f"{len(destinations)} distinct destinations exceed the limit of {MAX_DESTINATIONS}"
            )
        return packages


class DeliveryRequest(RequestFor[Place, Package]):
    """What a customer asks for: packages, their destinations and the QoS."""

    @property
    def destinations(self) -> tuple[StationId, ...]:
        """The distinct destinations, in the order of the packages."""
        return tuple(dict.fromkeys(package.destination.station_id for package in self.packages))

    @property
    def has_windows(self) -> bool:
        """Whether loading has to be over by some moment, or a hand-over has a window."""
        return self.latest_pickup_at is not None or any(
            each.not_before_at is not None or each.latest_at is not None for each in self.packages
        )

    @property
    def needs_proof(self) -> bool:
        """Whether some package is handed over only with a proof."""
        return any(each.dropoff_verification is not None for each in self.packages)

    @property
    def begins_after(self) -> datetime | None:
        """The moment before which no plan may begin; None without one.

        A plan begins at `earliest_pickup_at` or later. With `latest_pickup_at` it may begin before,
        and only loading waits.
        """
        return None if self.latest_pickup_at is not None else self.earliest_pickup_at

    @property
    def first_hand_over_at(self) -> datetime | None:
        """The moment before which no package changes hands for the last time it has to.

        The earliest pickup, or the first opening of a window if every package has one, whichever is
        later; None without either.
        """
        openings = [each.not_before_at for each in self.packages if each.not_before_at is not None]
        moments = [] if self.earliest_pickup_at is None else [self.earliest_pickup_at]
        if len(openings) == len(self.packages):
            moments.append(min(openings))
        return max(moments, default=None)

    @property
    def latest_at(self) -> datetime | None:
        """The first moment at which some limit of the request has passed; None without limits."""
        limits = [self.qos.deadline_at, self.latest_pickup_at]
        limits += [each.latest_at for each in self.packages]
        return min((each for each in limits if each is not None), default=None)

    def kept_until(self, package_id: PackageId, promised_at: datetime) -> datetime:
        """The last moment that keeps the promise of a package: `promised_at` or later.

        It is later by what the customer allows (`may_be_later_s`), or the end of the package's
        window if it has both ends; but no later than the deadline and the end of the window. A
        window of the pickup is a limit of the plan, and says nothing of when packages may come.
        """
        package = next(each for each in self.packages if each.package_id == package_id)
        allowed = promised_at + timedelta(seconds=self.qos.may_be_later_s)
        limits = [each for each in (self.qos.deadline_at, package.latest_at) if each is not None]
        return max(promised_at, min(limits if _has_window(package) else [allowed, *limits]))

    @property
    def weight(self) -> float:
        """How much a second until the last delivery counts when a fleet is planned."""
        weight = _PRIORITY_WEIGHT if self.qos.priority == "PRIORITY" else 1.0
        return weight * (WINDOW_WEIGHT if all(map(_has_window, self.packages)) else 1.0)

    @property
    def may_share_trip(self) -> bool:
        """Whether the packages may fly together with those of other deliveries."""
        return (
            self.qos.pooling
            and not self.has_windows
            and self.qos.deadline_at is None
            and not any(package.needs_cargo_check for package in self.packages)
        )

    def begun_after_wait(self, asked_at: datetime) -> "DeliveryRequest":
        """The request that begins when it has waited for deliveries that share its trip."""
        if not self.may_share_trip or self.qos.pooling_wait_s == 0:
            return self
        waited_at = asked_at + timedelta(seconds=self.qos.pooling_wait_s)
        update = {"earliest_pickup_at": max(waited_at, self.earliest_pickup_at or waited_at)}
        return self.model_copy(update=update)

    @property
    def payload_kg(self) -> float:
        """The mass of all packages together."""
        return sum(package.mass_kg for package in self.packages)


def _has_window(package: Package) -> bool:
    """Whether the package has a window for its hand-over with both ends."""
    return package.not_before_at is not None and package.latest_at is not None
