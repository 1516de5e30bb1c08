"""Other views of deliveries: plan, proof, what a provider sees of them and what it earned."""

from datetime import date
from typing import Annotated

from pydantic import Field

from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.message import FleetMoment, Soc
from skyway.delivery.offer import Currency
from skyway.delivery.request import Place
from skyway.geo import Position
from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, ProviderId, StationId
from skyway.json_model import JsonModel, QueryModel
from skyway_gateway.deliveries.lifecycle.delivery import (
    Activity,
    Delivery,
    DeliveryState,
    PackageState,
    PackageStatus,
)
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission


class DeliveryPlan(JsonModel):
    """How a delivery is flown; each plan counts seconds from its mission's `start_at`."""

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    state: Annotated[DeliveryState, Field(description="How far the delivery is.")]
    missions: Annotated[
        tuple[FlownMission, ...],
        Field(description="Its missions with their plans; empty before it is planned."),
    ]


class PackageProof(JsonModel):
    """The proof of one package; null members while the package is on its way."""

    package_id: Annotated[PackageId, Field(description="The customer's id of the package.")]
    state: Annotated[PackageState, Field(description="Where the package is in its life.")]
    custodian: Annotated[Custodian, Field(description="Who holds the package now.")]
    station_id: Annotated[
        StationId | None, Field(description="Where it was handed over; null on its way.")
    ] = None
    position: Annotated[
        Position | None,
        Field(description="Where the drone stood: longitude and latitude, degrees."),
    ] = None
    at: Annotated[FleetMoment | None, Field(description="When it was handed over.")] = None
    mission_id: Annotated[MissionId | None, Field(description="The mission that carried it.")] = (
        None
    )
    provider_id: Annotated[ProviderId | None, Field(description="The provider of the drone.")] = (
        None
    )
    drone_id: Annotated[DroneId | None, Field(description="The drone that carried it.")] = None
    soc: Annotated[
        Soc | None, Field(description="The drone's state of charge at the hand-over.")
    ] = None
    mass_kg: Annotated[
        float | None, Field(description="The measured mass of this package, kilograms.")
    ] = None
    load_before_kg: Annotated[
        float | None, Field(description="What the drone carried before the hand-over, kilograms.")
    ] = None
    load_after_kg: Annotated[
        float | None, Field(description="What the drone carried after the hand-over, kilograms.")
    ] = None


class DeliveryProof(JsonModel):
    """The proof of all packages of a delivery."""

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    state: Annotated[DeliveryState, Field(description="How far the delivery is.")]
    packages: Annotated[tuple[PackageProof, ...], Field(description="The proof of each package.")]


class ProviderDelivery(JsonModel):
    """What a provider sees of a delivery that one of its drones flies."""

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    state: Annotated[DeliveryState, Field(description="How far the delivery is.")]
    activity: Annotated[
        Activity | None,
        Field(
            description="What the drone does now; null before the start and after the end, and "
            "when drones of several providers fly the delivery."
        ),
    ]
    pickup: Annotated[Place, Field(description="Where the packages are picked up.")]
    missions: Annotated[
        tuple[FlownMission, ...], Field(description="The missions of the provider's own drones.")
    ]
    packages: Annotated[
        tuple[PackageStatus, ...],
        Field(description="The packages that the provider's own drones carry or carried."),
    ]
    created_at: FleetMoment
    updated_at: FleetMoment


def proof_of(delivery: Delivery) -> DeliveryProof:
    """The proof of each package of a delivery."""
    return DeliveryProof(
        delivery_id=delivery.delivery_id,
        state=delivery.state,
        packages=tuple(
            PackageProof(
                package_id=package.package_id,
                state=package.state,
                custodian=package.custodian,
                **dict(package.proof or {}),
            )
            for package in delivery.packages
        ),
    )


def for_provider(delivery: Delivery) -> ProviderDelivery:
    """A delivery as the provider of one of its drones sees it."""
    return ProviderDelivery(
        delivery_id=delivery.delivery_id,
        state=delivery.state,
        activity=delivery.activity,
        pickup=delivery.pickup,
        missions=delivery.missions,
        packages=delivery.packages,
        created_at=delivery.created_at,
        updated_at=delivery.updated_at,
    )


class EarningsQuery(QueryModel):
    """Which missions count: those that ended in [from, to); without limits, all."""

    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="Only missions that ended at this moment or later."),
    ] = None
    to_at: Annotated[
        FleetMoment | None,
        Field(alias="to", description="Only missions that ended before this moment."),
    ] = None


class DayEarnings(JsonModel):
    """The earnings of one day in UTC, fleet time."""

    day: Annotated[date, Field(description="The day in UTC, fleet time.")]
    currency: Currency
    deliveries: Annotated[
        int, Field(description="Deliveries with a mission that was completed on this day.")
    ]
    missions: Annotated[int, Field(description="Missions that were completed on this day.")]
    amount: Annotated[int, Field(description="What they brought, in minor units of the currency.")]


class Earnings(JsonModel):
    """A provider's earnings: the sums in the currency of the latest mission, and each day.

    Days in an earlier currency are listed, but not part of the sums.
    """

    provider_id: Annotated[ProviderId, Field(description="The provider.")]
    currency: Annotated[
        Currency | None,
        Field(description="The currency of the latest mission; null without missions."),
    ]
    deliveries: Annotated[int, Field(description="Deliveries on all days, in this currency.")]
    missions: Annotated[int, Field(description="Missions on all days, in this currency.")]
    amount: Annotated[int, Field(description="What they brought, in minor units of the currency.")]
    by_day: Annotated[
        tuple[DayEarnings, ...],
        Field(description="Each day with completed missions, the first day first."),
    ]


def earnings_of(provider_id: ProviderId, days: tuple[DayEarnings, ...]) -> Earnings:
    """The earnings with the sums over these days, which are sorted by time."""
    currency = days[-1].currency if days else None
    summed = [day for day in days if day.currency == currency]
    return Earnings(
        provider_id=provider_id,
        currency=currency,
        deliveries=sum(day.deliveries for day in summed),
        missions=sum(day.missions for day in summed),
        amount=sum(day.amount for day in summed),
        by_day=days,
    )
