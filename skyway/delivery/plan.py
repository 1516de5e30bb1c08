"""The plan: what one drone does, step by step, from time 0 to the last delivery."""

from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import Field

from skyway.ids import PackageId, StationId
from skyway.json_model import JsonModel

Seconds = Annotated[float, Field(description="seconds since the plan's start")]
Charge = Annotated[float, Field(description="state of charge, 0 to 1")]


class PlanStatus(StrEnum):
    """What is known of a plan: proven best, only found, proven impossible, or neither."""

    OPTIMAL = "optimal"
    FEASIBLE = "feasible"
    INFEASIBLE = "infeasible"
    UNKNOWN = "unknown"


class PickUp(JsonModel):
    """The packages are taken on board."""

    kind: Annotated[Literal["PICK_UP"], Field(description="Always PICK_UP.")] = "PICK_UP"
    station_id: StationId
    package_ids: Annotated[
        tuple[PackageId, ...], Field(description="The packages that are taken on board.")
    ]
    start_s: Seconds
    end_s: Seconds


class Fly(JsonModel):
    """One drone service: a segment is flown; a landing that the plan makes at its end is in it."""

    kind: Annotated[Literal["FLY"], Field(description="Always FLY.")] = "FLY"
    from_id: Annotated[
        StationId, Field(alias="from", description="The station where the segment begins.")
    ]
    to_id: Annotated[
        StationId, Field(alias="to", description="The station where the segment ends.")
    ]
    start_s: Seconds
    end_s: Seconds
    load_kg: Annotated[float, Field(description="The mass on board in kilograms.")]
    energy_j: Annotated[float, Field(description="Energy of the flight in joules.")]
    soc_end: Charge
    time_factor: Annotated[
        float,
        Field(
            exclude_if=lambda value: value == 1.0,
            description="The time of the flight without its landing, divided by its time in still "
            "air; left out if it is 1.",
        ),
    ] = 1.0
    energy_factor: Annotated[
        float,
        Field(
            exclude_if=lambda value: value == 1.0,
            description="The energy of the flight without its landing, divided by power × time of "
            "the flight; left out if it is 1.",
        ),
    ] = 1.0


class Wait(JsonModel):
    """The drone stands at a station, needing neither pad nor energy."""

    kind: Annotated[Literal["WAIT"], Field(description="Always WAIT.")] = "WAIT"
    station_id: StationId
    start_s: Seconds
    end_s: Seconds


class Recharge(JsonModel):
    """The drone holds a pad and charges."""

    kind: Annotated[Literal["RECHARGE"], Field(description="Always RECHARGE.")] = "RECHARGE"
    station_id: StationId
    pad: Annotated[int, Field(description="The number of the pad, from 0.")]
    start_s: Seconds
    end_s: Seconds
    soc_start: Charge
    soc_end: Charge
    #: In the JSON only where the network limits the power.
    power_w: Annotated[
        float | None,
        Field(
            gt=0,
            exclude_if=lambda value: value is None,
            description="The power that the pad gives in watts; without a limit if missing.",
        ),
    ] = None


class Deliver(JsonModel):
    """The packages for this station are handed over; they count as delivered at the end."""

    kind: Annotated[Literal["DELIVER"], Field(description="Always DELIVER.")] = "DELIVER"
    station_id: StationId
    package_ids: Annotated[
        tuple[PackageId, ...], Field(description="The packages that are handed over.")
    ]
    start_s: Seconds
    end_s: Seconds


Step = Annotated[PickUp | Fly | Wait | Recharge | Deliver, Field(discriminator="kind")]


class PackageDelivery(JsonModel):
    """When and where one package is delivered."""

    package_id: PackageId
    station_id: StationId
    delivered_s: Seconds


class Infeasibility(JsonModel):
    """Why no plan exists; one code and a sentence with the numbers."""

    code: Annotated[
        Literal[
            "OVERWEIGHT",
            "TOO_LARGE",
            "HANDLING",
            "DESTINATION_UNREACHABLE",
            "OUT_OF_RANGE",
            "NO_PAD_IN_TIME",
            "TOO_LATE",
            "WINDOW_MISSED",
        ],
        Field(description="Why, for programs."),
    ]
    detail: Annotated[str, Field(description="Why, for people.")]
    #: In the JSON only of WINDOW_MISSED.
    station_id: Annotated[
        StationId | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Where the window is missed; only with WINDOW_MISSED.",
        ),
    ] = None
    late_s: Annotated[
        float | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Seconds by which the window is missed; only with WINDOW_MISSED.",
        ),
    ] = None


class Plan(JsonModel):
    """The result of a composition.

    Steps follow one another without gap or overlap from time 0. Without a plan (`status` is
    infeasible or unknown) times and energies are None and `steps` is empty.
    """

    status: Annotated[
        PlanStatus,
        Field(description="Whether the plan is proven best, found, proven impossible, or unknown."),
    ]
    delivery_time_s: Annotated[
        float | None,
        Field(description="Seconds from the start to the last delivery; null without a plan."),
    ] = None
    lower_bound_s: Annotated[
        float | None, Field(description="No plan delivers in fewer seconds than this.")
    ] = None
    energy_j: Annotated[
        float | None, Field(description="Energy of all flights in joules; null without a plan.")
    ] = None
    flight_s: Annotated[
        float | None, Field(description="Seconds in flight; null without a plan.")
    ] = None
    waiting_s: Annotated[
        float | None, Field(description="Seconds of waiting; null without a plan.")
    ] = None
    recharging_s: Annotated[
        float | None, Field(description="Seconds on pads; null without a plan.")
    ] = None
    steps: Annotated[
        tuple[Step, ...], Field(description="What the drone does, in order, without gaps.")
    ] = ()
    deliveries: Annotated[
        tuple[PackageDelivery, ...], Field(description="When and where each package is delivered.")
    ] = ()
    #: What a strategy counted: `strategy`, `elapsed_s`, and keys of its own.
    stats: dict[str, Any] = Field(
        default_factory=dict,
        exclude_if=lambda value: not value,
        description="What the strategy counted: strategy, elapsed_s, and more; left out of what "
        "customers see of deliveries.",
    )
    #: In the JSON only when infeasible.
    infeasibility: Annotated[
        Infeasibility | None,
        Field(
            exclude_if=lambda value: value is None,
            description="Why there is no plan; only if it is proven.",
        ),
    ] = None

    @property
    def pickup_s(self) -> float:
        """When the drone begins to load, seconds since the plan's start; 0 if it loads nothing."""
        return next((step.start_s for step in self.steps if isinstance(step, PickUp)), 0.0)

    @property
    def is_flyable(self) -> bool:
        """Whether there are steps to fly."""
        return self.status in (PlanStatus.OPTIMAL, PlanStatus.FEASIBLE)
