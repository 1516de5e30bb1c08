"""A share: one of the deliveries whose packages fly together with one mission.

The mission of one delivery, the host, carries packages of other deliveries, its guests. Customers
choose the ids of their packages, and two customers may choose the same. So a guest's packages fly
under ids of their own.
"""

from collections.abc import Collection, Iterable
from datetime import datetime
from typing import Annotated

from pydantic import Field, TypeAdapter

from skyway.bounds import Moment
from skyway.delivery.offer import Price
from skyway.delivery.payment_terms import PaymentTerms
from skyway.ids import DeliveryId, MissionId, PackageId, StationId
from skyway.json_model import JsonModel


class NearPickup(JsonModel):
    """A guest whose packages are handed over at the host's pickup, not at that of its request."""

    asked_station_id: Annotated[StationId, Field(description="The pickup of its request.")]
    within_m: Annotated[
        float, Field(gt=0, description="How far its customer accepts other stations, metres.")
    ]
    away_m: Annotated[float, Field(ge=0, description="How far the host's pickup is, metres.")]


class Delay(JsonModel):
    """A guest whose packages are ready later than those of its host."""

    host_at: Annotated[
        Moment | None,
        Field(description="Without guests the host may not begin before this moment."),
    ]
    ready_at: Annotated[
        Moment, Field(description="With this guest the mission may not begin before this moment.")
    ]


class Share(JsonModel):
    """A delivery's share of a mission; the host's share has the id of the mission itself.

    A guest's share has a mission id of its own, under which the gateway gets its reports.
    """

    mission_id: MissionId
    delivery_id: DeliveryId
    attempt: Annotated[
        int, Field(ge=1, description="The number of the booking that made it, from 1.")
    ]
    trip: Annotated[
        int, Field(ge=1, description="The number of the trip within its booking, from 1.")
    ] = 1
    price: Annotated[Price, Field(description="What it costs alone.")]
    pooled_price: Annotated[Price, Field(description="What it costs on a shared trip.")]
    payment_terms: Annotated[PaymentTerms, Field(description="The terms of its price.")] = (
        PaymentTerms()
    )
    packages: Annotated[
        dict[PackageId, PackageId],
        Field(description="The customer's id of each package, by the id under which it flies."),
    ]
    is_pooled: Annotated[
        bool, Field(description="Whether the drone has loaded packages of other deliveries too.")
    ] = False
    report_seq: Annotated[
        int, Field(ge=0, description="The number of its last report; the host's is in its row.")
    ] = 0
    traceparent: Annotated[str | None, Field(description="The trace of its request.")] = None
    delay: Annotated[
        Delay | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Set if its packages are ready later than those of its host.",
        ),
    ] = None
    near: Annotated[
        NearPickup | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Set if its packages are handed over at another pickup than it asked for.",
        ),
    ] = None

    @property
    def charged(self) -> Price:
        """What the customer pays: the pooled price once the drone has loaded for others too."""
        return self.pooled_price if self.is_pooled else self.price

    def own(self, package_ids: Iterable[PackageId]) -> tuple[PackageId, ...]:
        """The customer's ids of those packages that belong to this share; others are left out."""
        return tuple(self.packages[each] for each in package_ids if each in self.packages)

    def flying(self, package_ids: Iterable[PackageId]) -> tuple[PackageId, ...]:
        """The ids under which the packages with these customer's ids fly."""
        asked = set(package_ids)
        return tuple(flown for flown, own in self.packages.items() if own in asked)


_SHARES: TypeAdapter[tuple[Share, ...]] = TypeAdapter(tuple[Share, ...])


def shares_json(shares: tuple[Share, ...]) -> str | None:
    """The shares of a mission as they are stored; None if the mission is not shared."""
    return _SHARES.dump_json(shares).decode() if shares else None


def read_shares(text: str) -> tuple[Share, ...]:
    """The shares of a mission from their stored form; members of later versions are ignored."""
    return _SHARES.validate_json(text, extra="ignore")


def ready_at(
    shares: Iterable[Share], package_ids: Collection[PackageId], *, planned_at: datetime | None
) -> datetime | None:
    """The moment before which a mission with these packages may not begin; None without one.

    `planned_at` is this moment in the current plan. It counts if no guest delays the host.
    """
    delays = [(each.delay, each.packages) for each in shares if each.delay is not None]
    host_at = delays[0][0].host_at if delays else planned_at
    flying = {*package_ids}
    late = (delay.ready_at for delay, packages in delays if flying & packages.keys())
    return max((at for at in (host_at, *late) if at is not None), default=None)


def flight_id(mission_id: MissionId, number: int) -> PackageId:
    """The id under which a guest's package flies: its mission, and its number from 1."""
    return PackageId(f"{mission_id}-{number}")
