"""Views of deliveries: plan, proof, track, what a provider sees of them and what it earned."""

from collections.abc import Iterator, Sequence
from datetime import date
from itertools import pairwise
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field

from skyway.contracts.delivery_event_data import Custodian
from skyway.contracts.message import FleetMoment, Soc, utc_text
from skyway.contracts.track import Track, TrackedMission, TrackedStep
from skyway.delivery.offer import Currency
from skyway.delivery.request import Place
from skyway.geo import Position
from skyway.ids import DeliveryId, DroneId, MissionId, PackageId, ProviderId, StationId
from skyway.json_model import JsonModel, QueryModel
from skyway.runtime.sql.connection import AnyRow
from skyway.units import ms_to_moment
from skyway_gateway.deliveries.lifecycle.delivery import (
    Activity,
    Delivery,
    DeliveryState,
    PackageState,
    PackageStatus,
)
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.personal_data.details import (
    NO_DATA,
    Contact,
    HandOverDetails,
    PersonalData,
)
from skyway_gateway.personal_data.store import StoredPersonalData


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


_WHY: Final = "taken together, the packages of all providers that exchange deliveries come earlier"
_REASONS: Final = {
    "CAME": f"it came from another provider, with its price and its terms: {_WHY}",
    "LEFT": f"another provider flies it, and is paid for it: {_WHY}",
}


class Exchange(JsonModel):
    """A mission that came to a provider, or left it, while it waited for its drone.

    It does not say which the other provider is.
    """

    delivery_id: Annotated[DeliveryId, Field(description="The id of the delivery.")]
    mission_id: Annotated[MissionId, Field(description="The id of the mission.")]
    direction: Annotated[
        Literal["CAME", "LEFT"],
        Field(description="CAME: the provider's drone flies it now; LEFT: it does not any more."),
    ]
    at: Annotated[FleetMoment, Field(description="When it changed its provider, fleet time.")]
    reason: Annotated[str, Field(description="Why, in words.")]

    @classmethod
    def of_row(cls, row: AnyRow) -> Self:
        """The exchange of a row of `exchanges`."""
        return cls(
            delivery_id=row.delivery_id,
            mission_id=row.mission_id,
            direction=row.direction,
            at=ms_to_moment(row.at_ms),
            reason=_REASONS[row.direction],
        )


class ProviderPackage(HandOverDetails, PackageStatus):
    """A package of a provider's drone; while the drone flies for it, also who takes it."""


class ProviderDelivery(JsonModel):
    """What a provider sees of a delivery that one of its drones flies.

    It sees people without their e-mail addresses, and only while its drones fly for them.
    """

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
    sender: Annotated[
        Contact | None,
        Field(description="Who brings the packages; null when no drone of the provider flies."),
    ] = None
    missions: Annotated[
        tuple[FlownMission, ...], Field(description="The missions of the provider's own drones.")
    ]
    packages: Annotated[
        tuple[ProviderPackage, ...],
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


def for_provider(delivery: Delivery, stored: StoredPersonalData | None = None) -> ProviderDelivery:
    """A delivery as the provider of one of its drones sees it."""
    data = NO_DATA if stored is None or not delivery.live_missions else stored.data
    return ProviderDelivery(
        delivery_id=delivery.delivery_id,
        state=delivery.state,
        activity=delivery.activity,
        pickup=delivery.pickup,
        sender=data.sender and data.sender.without_email,
        missions=delivery.missions,
        packages=tuple(_for_provider(each, delivery, data) for each in delivery.packages),
        created_at=delivery.created_at,
        updated_at=delivery.updated_at,
    )


def _for_provider(
    package: PackageStatus, delivery: Delivery, data: PersonalData
) -> ProviderPackage:
    """A package with who takes it, as long as a drone flies for it."""
    is_flown = any(each.mission_id == package.mission_id for each in delivery.live_missions)
    own = data if is_flown and not package.is_settled else NO_DATA
    details = own.of_package(package.package_id)
    return ProviderPackage.model_construct(
        **dict(package),
        recipient=details.recipient and details.recipient.without_email,
        instructions=details.instructions,
    )


class EarningsQuery(QueryModel):
    """Which lines of the ledger count: those written in [from, to); without limits, all."""

    from_at: Annotated[
        FleetMoment | None,
        Field(alias="from", description="Only lines that were written at this moment or later."),
    ] = None
    to_at: Annotated[
        FleetMoment | None,
        Field(alias="to", description="Only lines that were written before this moment."),
    ] = None


class DayEarnings(JsonModel):
    """The earnings of one day in UTC, fleet time."""

    day: Annotated[date, Field(description="The day in UTC, fleet time.")]
    currency: Currency
    deliveries: Annotated[
        int, Field(description="Deliveries with lines of the ledger of this day.")
    ]
    missions: Annotated[int, Field(description="Missions with lines of this day.")]
    amount: Annotated[int, Field(description="What they brought, in minor units of the currency.")]


class Earnings(JsonModel):
    """A provider's earnings: the sums in the currency of the latest line, and each day.

    Days in an earlier currency are listed, but not part of the sums.
    """

    provider_id: Annotated[ProviderId, Field(description="The provider.")]
    currency: Annotated[
        Currency | None,
        Field(description="The currency of the latest line; null without lines."),
    ]
    deliveries: Annotated[int, Field(description="Deliveries on all days, in this currency.")]
    missions: Annotated[int, Field(description="Missions on all days, in this currency.")]
    amount: Annotated[int, Field(description="What they brought, in minor units of the currency.")]
    by_day: Annotated[
        tuple[DayEarnings, ...],
        Field(description="Each day with lines, the first day first."),
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


class PointGeometry(JsonModel):
    """A GeoJSON point."""

    type: Annotated[Literal["Point"], Field(description="The GeoJSON type.")] = "Point"
    coordinates: Annotated[Position, Field(description="Longitude and latitude, degrees.")]


class LineGeometry(JsonModel):
    """A GeoJSON line of at least two positions."""

    type: Annotated[Literal["LineString"], Field(description="The GeoJSON type.")] = "LineString"
    coordinates: Annotated[
        tuple[Position, ...],
        Field(min_length=2, description="Positions in order: longitude and latitude, degrees."),
    ]


class Feature(JsonModel):
    """A point or a line; `properties.kind` is FLOWN, PLANNED, DRONE or STATION."""

    type: Annotated[Literal["Feature"], Field(description="The GeoJSON type.")] = "Feature"
    geometry: Annotated[
        PointGeometry | LineGeometry, Field(discriminator="type", description="A point or a line.")
    ]
    properties: Annotated[
        dict[str, Any],
        Field(description="`kind`: FLOWN, PLANNED, DRONE or STATION; it decides the others."),
    ]  # JSON, other members for each kind


class FeatureCollection(JsonModel):
    """The answer of /v1/deliveries/{delivery_id}/track."""

    type: Annotated[Literal["FeatureCollection"], Field(description="The GeoJSON type.")] = (
        "FeatureCollection"
    )
    features: Annotated[
        tuple[Feature, ...],
        Field(description="The lines and drone of each mission, then the stations."),
    ]


def feature_collection(delivery: Delivery, track: Track) -> FeatureCollection:
    """Each mission's lines and drone, and each station of its steps once."""
    features = [feature for mission in track.missions for feature in _of_mission(mission)]
    return FeatureCollection(features=(*features, *_stations(delivery, track)))


def _of_mission(mission: TrackedMission) -> Iterator[Feature]:
    about = {
        "mission_id": mission.mission_id,
        "provider_id": mission.provider_id,
        "drone_id": mission.drone_id,
    }
    flights = [step for step in mission.steps if step.kind == "FLY"]
    flown = [step for step in flights if step.status == "ENDED"]
    under_way = [step for step in flights if step.status == "UNDER_WAY"]
    ahead = [step for step in flights if step.status == "PLANNED"]
    here = [] if mission.position is None else [mission.position]

    began = [step.from_position for step in under_way]
    yield from _way("FLOWN", [*_places(flown), *began, *(here if under_way else [])], about)
    goes_on = [step.to_position for step in under_way]
    ahead_places = [*(here if under_way else []), *goes_on, *_places(ahead)]
    yield from _way("PLANNED", ahead_places, {**about, **_times(under_way + ahead)})
    if mission.position is not None:
        at = mission.position_at and utc_text(mission.position_at)
        properties = {"kind": "DRONE", **about, "soc": mission.soc, "at": at}
        yield Feature(geometry=PointGeometry(coordinates=mission.position), properties=properties)


def _places(flights: Sequence[TrackedStep]) -> list[Position]:
    """The positions along consecutive flights."""
    return [place for step in flights for place in (step.from_position, step.to_position)]


def _way(kind: str, places: Sequence[Position], about: dict[str, Any]) -> Iterator[Feature]:
    """A line as one feature; no feature where the drone does not move."""
    distinct = [*places[:1], *(after for before, after in pairwise(places) if after != before)]
    if len(distinct) > 1:
        geometry = LineGeometry(coordinates=tuple(distinct))
        yield Feature(geometry=geometry, properties={"kind": kind, **about})


def _times(steps: Sequence[TrackedStep]) -> dict[str, Any]:
    if not steps:
        return {}
    return {"start_at": utc_text(steps[0].start_at), "end_at": utc_text(steps[-1].end_at)}


def _stations(delivery: Delivery, track: Track) -> Iterator[Feature]:
    """The stations of the missions' steps, with what happens there."""
    steps: dict[StationId, list[TrackedStep]] = {}
    for mission in track.missions:
        for step in mission.steps:
            steps.setdefault(step.station_id, []).append(step)
    for station_id, stops in steps.items():
        properties = {
            "kind": "STATION",
            "station_id": station_id,
            "is_pickup": station_id == delivery.pickup.station_id,
            "stops": [_stop(step) for step in stops if step.kind != "FLY"],
        }
        place = PointGeometry(coordinates=stops[0].to_position)
        yield Feature(geometry=place, properties=properties)


def _stop(step: TrackedStep) -> dict[str, Any]:
    return {
        "kind": step.kind,
        "status": step.status,
        "start_at": utc_text(step.start_at),
        "end_at": utc_text(step.end_at),
        "package_ids": list(step.package_ids),
    }
