"""The registry is asked which drones could fly a request, and why others cannot.

The answer is `skyway.contracts.shortlist.Candidates`.
"""

from collections.abc import Iterable
from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field

from skyway.contracts.message import FleetMoment, Soc
from skyway.delivery.offer import Tariff
from skyway.delivery.qos import ProviderChoice
from skyway.delivery.request import DeliveryRequest, Package
from skyway.drone.cargo import CargoNeeds
from skyway.drone.learned_values import AS_MODELLED, LearnedValues, model_as_learned
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, PackageId, ProviderId, StationId
from skyway.json_model import WireModel

#: At most this many candidates of one provider, and of all (docs/reference/booking.md).
MAX_CANDIDATES_PER_PROVIDER = 5
MAX_CANDIDATES = 60

#: One call asks about at most this many requests: the most that the gateway books at a time.
MOST_QUERIES: Final = 64

#: Where the registry answers about several requests.
CANDIDATE_LISTS: Final = "/internal/candidate-lists"


#: Who confirms what is loaded: the drone's own scale, or a loader of the provider.
Loading = Literal["AUTOMATIC", "CONFIRMED"]


#: What a drone does after its last hand-over until it is booked again: it flies home, stays where
#: it is, goes to the best parking station, or goes near the next pickup that is expected. There it
#: charges.
Standby = Literal["HOME", "STAY", "PARKING", "NEXT_PICKUP"]


class CargoPackage(CargoNeeds, WireModel):
    """A package of a request in which some package needs more than lift."""

    package_id: PackageId
    mass_kg: Annotated[float, Field(ge=0, description="Mass in kilograms.")]


def cargo_of(packages: Iterable[Package]) -> tuple[CargoPackage, ...]:
    """The packages, if some package needs more than lift; else nothing."""
    listed = tuple(packages)
    if not any(package.needs_cargo_check for package in listed):
        return ()
    return tuple(
        CargoPackage(**{name: getattr(package, name) for name in CargoPackage.model_fields})
        for package in listed
    )


class CandidateQuery(WireModel):
    """What must be carried from where, which providers may serve, and which drones have refused.

    If no drone of a provider can lift `payload_kg` in one trip, the provider sends its strongest
    drones that lift `heaviest_kg`: the request may be split over several trips.
    """

    pickup_station_id: StationId
    pickup_position: Annotated[Position, Field(description="Where the pickup is, in degrees.")]
    payload_kg: Annotated[
        float, Field(ge=0, description="The mass of all packages together, in kilograms.")
    ]
    heaviest_kg: Annotated[
        float, Field(ge=0, description="The mass of the heaviest package, in kilograms.")
    ] = 0.0
    packages: Annotated[
        tuple[CargoPackage, ...],
        Field(
            exclude_if=lambda value: not value,
            description="All packages, if some package needs more than lift; else empty.",
        ),
    ] = ()
    providers: Annotated[ProviderChoice, Field(description="Which providers may serve.")]
    excluded_drone_ids: Annotated[
        tuple[DroneId, ...], Field(description="Drones that refused before.")
    ] = ()
    kept_drone_ids: Annotated[
        tuple[DroneId, ...],
        Field(description="Drones of a held offer: named if they are able, even if others rank."),
    ] = ()

    @classmethod
    def of(
        cls,
        request: DeliveryRequest,
        pickup_position: Position,
        *,
        providers: ProviderChoice,
        excluded_drone_ids: tuple[DroneId, ...] = (),
        kept_drone_ids: tuple[DroneId, ...] = (),
    ) -> Self:
        """The question about a request whose pickup is at this position."""
        return cls(
            pickup_station_id=request.pickup.station_id,
            pickup_position=pickup_position,
            payload_kg=request.payload_kg,
            heaviest_kg=max((package.mass_kg for package in request.packages), default=0.0),
            packages=cargo_of(request.packages),
            providers=providers,
            excluded_drone_ids=excluded_drone_ids,
            kept_drone_ids=kept_drone_ids,
        )


class CandidateQueries(WireModel):
    """Questions about several requests; one state of the fleets answers all of them."""

    queries: Annotated[
        tuple[CandidateQuery, ...],
        Field(min_length=1, max_length=MOST_QUERIES, description="One question for each request."),
    ]


class Candidate(WireModel):
    """A drone that could fly the request, as the registry knows it now.

    Its flights are planned with its `planned_model`; its `model` is what all drones of its type can
    do.
    """

    provider_id: ProviderId
    drone_id: DroneId
    model: DroneModel
    soc: Soc
    station_id: StationId
    home_station_id: StationId
    tariff: Tariff
    loading: Loading = "AUTOMATIC"
    standby: Standby = "HOME"
    no_shows: Annotated[
        int, Field(ge=0, description="Its provider's missions of late whose drones did not come.")
    ] = 0
    learned: Annotated[
        LearnedValues, Field(description="What its flights have shown about this drone.")
    ] = AS_MODELLED

    @property
    def planned_model(self) -> DroneModel:
        """The drone's model with what its flights have shown."""
        return model_as_learned(self.model, self.learned)


#: NO_DRONES to LOW_CHARGE come from the registry, the others from the planner and from booking.
#: DESTINATION_UNREACHABLE comes from both: the registry names drones in another network.
ProviderReasonCode = Literal[
    "NO_PROVIDER",
    "NOT_ADMITTED",
    "NOT_COMPARED",
    "NO_DRONES",
    "OVERWEIGHT",
    "TOO_LARGE",
    "HANDLING",
    "BUSY",
    "OFFLINE",
    "REFUSED",
    "LOW_CHARGE",
    "DESTINATION_UNREACHABLE",
    "OUT_OF_RANGE",
    "NO_PAD_IN_TIME",
    "WINDOW_MISSED",
    "TOO_LATE",
    "NO_PLAN_FOUND",
    "NO_WAY_HOME",
    "TOO_EXPENSIVE",
    "OTHER_CURRENCY",
    "TAKEN",
    "GROUND_STOP",
    "NOT_ENOUGH_DRONES",
    "OFFER_LOST",
]


#: The member of a BUSY reason's data that says when the first of the provider's drones is free.
FREE_AT: Final = "free_at"


class Possible(WireModel):
    """What would have been possible instead; the planner has checked it."""

    kind: Annotated[
        Literal["APART", "WITHOUT", "LESS", "LATER"],
        Field(
            description="APART: these packages each in a request of its own. WITHOUT: each other "
            "package in one. LESS: so much less mass. LATER: delivered at this moment."
        ),
    ]
    detail: Annotated[str, Field(description="The same for people.")]
    package_ids: Annotated[
        tuple[PackageId, ...], Field(description="APART and WITHOUT: the packages that are meant.")
    ] = ()
    less_kg: Annotated[
        float | None, Field(description="LESS: how much less all packages weigh, in kilograms.")
    ] = None
    at: Annotated[
        FleetMoment | None, Field(description="LATER: when the last package would be delivered.")
    ] = None


class ProviderReason(WireModel):
    """Why a provider makes no offer; `is_temporary` when asking again later may change it.

    `provider_id` is null for reasons that belong to no provider: NO_PROVIDER, and TOO_LATE when the
    deadline passed before any provider gave a reason.
    """

    provider_id: ProviderId | None
    code: Annotated[ProviderReasonCode, Field(description="Why, for programs.")]
    detail: Annotated[str, Field(description="Why, for people.")]
    is_temporary: Annotated[bool, Field(description="Whether asking again later may change it.")]
    #: Numbers behind the code, such as mass_kg and limit_kg.
    data: dict[str, Any] = Field(
        default_factory=dict,
        description="The numbers behind the code, such as mass_kg and limit_kg.",
    )
    possible: Annotated[
        tuple[Possible, ...], Field(description="What would have been possible instead.")
    ] = ()


class PayloadLimitQuery(WireModel):
    """Asks for the heaviest payload that any admitted provider's drone can lift."""

    providers: Annotated[ProviderChoice, Field(description="Which providers may serve.")]


class PayloadLimit(WireModel):
    """None if no admitted provider has a drone; `unknown_provider_ids` are not registered."""

    max_payload_kg: Annotated[
        float | None, Field(description="The heaviest payload in kilograms; null without a drone.")
    ]
    drone_model_id: Annotated[
        str | None, Field(description="The drone model that lifts it; null without a drone.")
    ]
    unknown_provider_ids: Annotated[
        tuple[ProviderId, ...], Field(description="Named providers that do not exist.")
    ]
