"""What the `data` of each type of delivery event holds."""

from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.contracts.candidate import ProviderReason
from skyway.contracts.message import FleetMoment
from skyway.delivery.offer import Price
from skyway.delivery.request import DeliveryRequest
from skyway.delivery.verification import ProofMethod
from skyway.geo import Position
from skyway.ids import DroneId, MissionId, PackageId, ProviderId, StationId
from skyway.json_model import JsonModel, WireModel

_Code = Annotated[
    str | None, Field(description="Why, for programs, in UPPER_SNAKE; null if there is no reason.")
]
_Detail = Annotated[str | None, Field(description="Why, for people; null if there is no reason.")]
_Evidence = Annotated[
    dict[str, Any],  # JSON of the drone's own sensors
    Field(description="What the drone measured, such as the masses before and after."),
]
_Eta = Annotated[
    FleetMoment | None, Field(description="When it is expected, fleet time; null if never.")
]
_PromisedAt = Annotated[
    FleetMoment | None, Field(description="When the plan of the booking delivers it (P50).")
]
_DueAt = Annotated[
    FleetMoment | None,
    Field(
        description="The promise from which lateness counts: the P90 of the booking, or "
        "`promised_at` if P50 was asked or no P90 was known, later by "
        "`qos.may_be_later_s`, or the end of the package's window. Fleet time."
    ),
]
_DeliveredAt = Annotated[
    FleetMoment | None, Field(description="When it was handed over; null if it was not.")
]
_PackageState = Annotated[str, Field(description="The state of the package, such as ON_BOARD.")]


class Custodian(JsonModel):
    """Who holds a package: a station, a drone, or the recipient at a station."""

    kind: Annotated[
        Literal["STATION", "DRONE", "RECIPIENT"], Field(description="What kind of holder it is.")
    ]
    id: Annotated[
        str, Field(description="Id of the drone or of the station; the recipient is at a station.")
    ]


class _FlownBy(WireModel):
    mission_id: MissionId
    provider_id: ProviderId
    drone_id: DroneId


class RequestedData(WireModel):
    """What the customer asked for."""

    reference: Annotated[str | None, Field(description="The customer's own word for the delivery.")]
    request: Annotated[DeliveryRequest, Field(description="The request as it was accepted.")]


class ChangedData(WireModel):
    """What the customer has changed; who may see the new values reads the delivery."""

    changed: Annotated[
        tuple[str, ...],
        Field(
            description="The names of what was changed, such as `recipient`, `metadata`, "
            "`earliest_pickup_at` and `packages.p1.instructions`."
        ),
    ]
    reference: Annotated[str | None, Field(description="The customer's own word for the delivery.")]
    request: Annotated[
        DeliveryRequest | None,
        Field(description="The request with its new times; null if no time was changed."),
    ]


class ScheduledData(WireModel):
    """The moment from which a drone is looked for; nothing is held before."""

    earliest_pickup_at: Annotated[
        FleetMoment,
        Field(
            description="The earliest pickup, or the first opening of a window if all packages "
            "have one and it is later, fleet time."
        ),
    ]
    books_from_at: Annotated[
        FleetMoment, Field(description="From then on a drone is looked for, fleet time.")
    ]


class ExpectedPackage(WireModel):
    """When a package is expected."""

    package_id: PackageId
    eta_at: Annotated[FleetMoment, Field(description="When it is expected, fleet time.")]
    eta_p90_at: Annotated[
        FleetMoment | None,
        Field(description="When it has come in nine of ten cases; null before that is known."),
    ] = None
    due_at: _DueAt = None


class PlannedData(WireModel):
    """The drone, the price, and when each package is expected."""

    attempt: Annotated[int, Field(ge=1, description="The number of this booking, from 1.")]
    provider_id: ProviderId
    drone_id: DroneId
    mission_ids: Annotated[
        tuple[MissionId, ...], Field(description="The missions of this booking.")
    ]
    price: Annotated[Price | None, Field(description="What all missions cost together.")]
    pickup_station_id: Annotated[
        StationId, Field(description="Where the packages are handed over to the drone.")
    ]
    pickup_at: Annotated[
        FleetMoment, Field(description="When the first drone begins to load, fleet time.")
    ]
    delivery_time_s: Annotated[
        float, Field(ge=0, description="Seconds from the start of the plan to the last delivery.")
    ]
    packages: Annotated[
        tuple[ExpectedPackage, ...], Field(description="The packages that are booked.")
    ]
    waiting_package_ids: Annotated[
        tuple[PackageId, ...], Field(description="The packages that wait for another mission.")
    ]


class PromisedData(WireModel):
    """When each package is promised: the promise is firm now."""

    packages: Annotated[
        tuple[ExpectedPackage, ...], Field(description="The packages whose promise is firm.")
    ]


class DispatchedData(_FlownBy):
    """Whose drone accepted the mission."""


class LoadedData(_FlownBy):
    """What the drone has on board."""

    station_id: Annotated[StationId | None, Field(description="Where it was loaded.")]
    package_ids: Annotated[tuple[PackageId, ...], Field(description="The packages on board.")]
    is_pooled: Annotated[
        bool,
        Field(description="Whether the drone has loaded packages of other deliveries too."),
    ] = False
    price: Annotated[
        Price | None,
        Field(description="What the mission costs from now on; a pooled trip costs less."),
    ] = None
    evidence: _Evidence


class StartedData(_FlownBy):
    """Whose drone took the first package on board."""


class AwaitedPackage(WireModel):
    """A package that is not handed over before its proof is there."""

    package_id: PackageId
    method: Annotated[ProofMethod, Field(description="PIN, PHOTO or SIGNATURE.")]


class ProofAwaitedData(_FlownBy):
    """The drone has come, and waits for proofs; who may see a PIN reads the delivery."""

    station_id: Annotated[StationId | None, Field(description="Where the drone waits.")]
    packages: Annotated[
        tuple[AwaitedPackage, ...], Field(description="The packages that wait for their proofs.")
    ]
    until_at: Annotated[
        FleetMoment,
        Field(description="Until when it waits, fleet time. Then the packages are taken back."),
    ]


class LatePackage(WireModel):
    """A package that comes after its `due_at`."""

    package_id: PackageId
    eta_at: _Eta
    promised_at: _PromisedAt
    due_at: _DueAt = None
    late_s: Annotated[float | None, Field(description="Seconds after `due_at`.")]
    deadline_at: Annotated[
        FleetMoment | None, Field(description="The deadline of the request; null without one.")
    ]
    latest_at: Annotated[
        FleetMoment | None, Field(description="The end of the package's window; null without one.")
    ] = None


class DelayedData(WireModel):
    """Which packages are late."""

    packages: Annotated[tuple[LatePackage, ...], Field(description="The late packages.")]


class ReplannedPackage(WireModel):
    """A package of the new plan; without `eta_at` it is left where the drone can land."""

    package_id: PackageId
    state: _PackageState
    eta_at: _Eta
    promised_at: _PromisedAt
    due_at: _DueAt = None
    later_s: Annotated[
        float | None, Field(description="Seconds after `promised_at`; below 0 if earlier.")
    ]


class ReplannedData(_FlownBy):
    """Why there is a new plan, and how much later than the plan of the booking it delivers."""

    revision: Annotated[int, Field(ge=1, description="The number of the new plan, from 2.")]
    code: _Code
    detail: _Detail
    given_up: Annotated[
        str | None,
        Field(description="Why the new plan delivers nothing; null if it delivers."),
    ]
    packages: Annotated[
        tuple[ReplannedPackage, ...], Field(description="The packages still on their way.")
    ]


class CompletionTimes(WireModel):
    """When the last package was handed over, and how long that took."""

    completed_at: Annotated[
        FleetMoment | None, Field(description="The moment of the last hand-over, fleet time.")
    ]
    delivery_time_s: Annotated[
        float | None, Field(description="Seconds from the start to that moment.")
    ]


class CompletedPackage(WireModel):
    """When a package was promised, and when it was handed over."""

    package_id: PackageId
    promised_at: _PromisedAt
    due_at: _DueAt = None
    delivered_at: _DeliveredAt


class CompletedData(WireModel):
    """What it cost, and the planned and the actual times."""

    price: Annotated[Price | None, Field(description="What the customer pays.")] = None
    planned: Annotated[CompletionTimes, Field(description="As the booking planned it (P50).")]
    actual: Annotated[CompletionTimes, Field(description="As it was.")]
    packages: Annotated[
        tuple[CompletedPackage, ...], Field(description="The times of each package.")
    ]


class EndedPackage(WireModel):
    """Where a package is at the end, and why."""

    package_id: PackageId
    state: _PackageState
    custodian: Annotated[Custodian, Field(description="Who holds the package.")]
    position: Annotated[
        Position | None,
        Field(description="Where it lies, in degrees, away from every station; else null."),
    ]
    delivered_at: _DeliveredAt
    code: _Code
    detail: _Detail


class EndedData(WireModel):
    """What the delivery cost, how far it came, and why not to the end."""

    price: Annotated[
        Price | None, Field(description="What the customer pays; null if it was never booked.")
    ] = None
    code: _Code
    detail: _Detail
    packages: Annotated[tuple[EndedPackage, ...], Field(description="Where each package is.")]


class RejectedData(WireModel):
    """Why no drone flies it."""

    detail: Annotated[str, Field(description="Why, for people.")]
    reasons: Annotated[
        tuple[ProviderReason, ...], Field(description="Why each provider makes no offer.")
    ]


class PackageDeliveredData(_FlownBy):
    """Where and when a package was handed over, with the drone's evidence."""

    package_id: PackageId
    station_id: StationId
    delivered_at: _DeliveredAt
    evidence: _Evidence


class PackageReturnedData(_FlownBy):
    """Where a package was handed back, and why."""

    package_id: PackageId
    station_id: Annotated[StationId | None, Field(description="Where it was handed back.")]
    returned_at: Annotated[FleetMoment, Field(description="When, fleet time.")]
    code: _Code
    detail: _Detail
    evidence: _Evidence


class PackageStrandedData(WireModel):
    """A package that will not be delivered: where it is, and why."""

    package_id: PackageId
    station_id: Annotated[
        StationId | None, Field(description="The station where it is; null away from stations.")
    ]
    position: Annotated[
        Position | None,
        Field(description="Where it lies, in degrees, away from every station; else null."),
    ]
    custodian: Annotated[Custodian, Field(description="Who holds the package.")]
    code: _Code
    detail: _Detail


class PackageCancelledData(WireModel):
    """A package that stays at the pickup, and why."""

    package_id: PackageId
    station_id: StationId
    custodian: Annotated[Custodian, Field(description="Who holds the package.")]
    code: _Code
    detail: _Detail
