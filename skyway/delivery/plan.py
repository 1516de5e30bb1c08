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

    kind: Literal["PICK_UP"] = "PICK_UP"
    station_id: StationId
    package_ids: tuple[PackageId, ...]
    start_s: Seconds
    end_s: Seconds


class Fly(JsonModel):
    """One drone service: a segment is flown; a landing that the plan makes at its end is in it."""

    kind: Literal["FLY"] = "FLY"
    from_id: Annotated[StationId, Field(alias="from")]
    to_id: Annotated[StationId, Field(alias="to")]
    start_s: Seconds
    end_s: Seconds
    load_kg: float
    energy_j: float
    soc_end: Charge


class Wait(JsonModel):
    """The drone stands at a station, needing neither pad nor energy."""

    kind: Literal["WAIT"] = "WAIT"
    station_id: StationId
    start_s: Seconds
    end_s: Seconds


class Recharge(JsonModel):
    """The drone holds a pad and charges."""

    kind: Literal["RECHARGE"] = "RECHARGE"
    station_id: StationId
    pad: int
    start_s: Seconds
    end_s: Seconds
    soc_start: Charge
    soc_end: Charge


class Deliver(JsonModel):
    """The packages for this station are handed over; they count as delivered at the end."""

    kind: Literal["DELIVER"] = "DELIVER"
    station_id: StationId
    package_ids: tuple[PackageId, ...]
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

    code: Literal[
        "OVERWEIGHT", "DESTINATION_UNREACHABLE", "OUT_OF_RANGE", "NO_PAD_IN_TIME", "TOO_LATE"
    ]
    detail: str


class Plan(JsonModel):
    """The result of a composition.

    Steps follow one another without gap or overlap from time 0. Without a plan (`status` is
    infeasible or unknown) times and energies are None and `steps` is empty.
    """

    status: PlanStatus
    delivery_time_s: float | None = None
    lower_bound_s: float | None = None
    energy_j: float | None = None
    flight_s: float | None = None
    waiting_s: float | None = None
    recharging_s: float | None = None
    steps: tuple[Step, ...] = ()
    deliveries: tuple[PackageDelivery, ...] = ()
    #: What a strategy counted: `strategy`, `elapsed_s`, and keys of its own.
    stats: dict[str, Any] = Field(default_factory=dict)
    #: In the JSON only when infeasible.
    infeasibility: Annotated[
        Infeasibility | None, Field(exclude_if=lambda value: value is None)
    ] = None

    @property
    def pickup_s(self) -> float:
        """When the drone begins to load, seconds since the plan's start; 0 if it loads nothing."""
        return next((step.start_s for step in self.steps if isinstance(step, PickUp)), 0.0)

    @property
    def is_flyable(self) -> bool:
        """Whether there are steps to fly."""
        return self.status in (PlanStatus.OPTIMAL, PlanStatus.FEASIBLE)
