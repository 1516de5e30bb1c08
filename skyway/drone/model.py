"""What a type of drone can do: its masses, speeds, powers, battery and charge curve."""

from functools import cached_property
from itertools import pairwise
from typing import Annotated, NamedTuple

from pydantic import Field, ValidationInfo, field_validator

from skyway.drone.cargo import CargoBay
from skyway.ids import ConnectorId, DroneModelId


class ChargePoint(NamedTuple):
    """A point of a charge curve: seconds on the pad since empty, and the charge reached then."""

    time_s: Annotated[float, Field(ge=0, le=1e9, strict=True)]
    soc: Annotated[float, Field(ge=0, le=1, strict=True)]


class DroneAbilities(CargoBay):
    """What a type of drone can do.

    Speed falls linearly from `speed_empty_mps` to `speed_full_mps` with the load; power rises as
    the total mass to the power 1.5. `charge_curve` is straight between its points, strictly rising
    in both, concave; its last point is the most that a drone can be charged to.
    """

    empty_mass_kg: Annotated[
        float,
        Field(ge=0.001, le=10_000, description="Mass without packages, in kilograms."),
    ]
    max_payload_kg: Annotated[
        float,
        Field(ge=0.001, le=10_000, description="The heaviest payload in kilograms."),
    ]
    battery_j: Annotated[
        float,
        Field(ge=1, le=1e12, description="Usable energy of the full battery in joules."),
    ]
    reserve_soc: Annotated[
        float,
        Field(
            ge=0,
            lt=1,
            description="The state of charge that every landing keeps, 0 to 1.",
        ),
    ] = 0.0
    speed_empty_mps: Annotated[
        float,
        Field(
            ge=0.01,
            le=1_000,
            description="Cruise speed without packages, in metres per second.",
        ),
    ]
    speed_full_mps: Annotated[
        float,
        Field(
            ge=0.01,
            le=1_000,
            description="Cruise speed with the heaviest payload, in metres per second.",
        ),
    ]
    power_empty_w: Annotated[
        float,
        Field(ge=0.001, le=1e9, description="Cruise power without packages, in watts."),
    ]
    stop_s: Annotated[
        float,
        Field(
            ge=0,
            le=1e6,
            description="Seconds that a landing and the next take-off take.",
        ),
    ] = 0.0
    stop_j: Annotated[
        float,
        Field(
            ge=0,
            le=1e12,
            description="Energy that a landing and the next take-off take, in joules.",
        ),
    ] = 0.0
    max_wind_mps: Annotated[
        float | None,
        Field(
            ge=0.1,
            le=100,
            exclude_if=lambda value: value is None,
            description="The strongest wind or gust in which it flies, in metres per second; "
            "without it any wind in which it moves forward.",
        ),
    ] = None
    connector: Annotated[
        ConnectorId | None,
        Field(
            exclude_if=lambda value: value is None,
            description="The connector with which it charges: it cannot charge on pads that have "
            "only others. Without it the drone fits every pad.",
        ),
    ] = None
    # The least number is checked below: pydantic would count only points that are valid.
    charge_curve: Annotated[
        tuple[ChargePoint, ...],
        Field(
            max_length=1_000,
            json_schema_extra={"minItems": 2},
            description="Points [seconds on the pad, state of charge], rising and concave.",
        ),
    ]

    # Of the field, not of the model: those run again wherever a finished model is put into another.
    @field_validator("charge_curve")
    @classmethod
    def _charge_curve_is_concave(
        cls, curve: tuple[ChargePoint, ...], info: ValidationInfo
    ) -> tuple[ChargePoint, ...]:
        if len(curve) < 2:
            raise ValueError(f"charge_curve has {len(curve)} points, at least 2 are due")
        slopes = []
        for before, after in pairwise(curve):
            if after.time_s <= before.time_s or after.soc <= before.soc:
                raise ValueError("charge_curve must rise strictly in time and in charge")
            slopes.append((after.soc - before.soc) / (after.time_s - before.time_s))
        for earlier, later in pairwise(slopes):
            if later > earlier * (1 + 1e-9):
                raise ValueError("charge_curve must be concave: charging may only get slower")
        # Missing when `reserve_soc` itself is wrong; that is another error.
        reserve_soc = info.data.get("reserve_soc")
        if reserve_soc is not None and reserve_soc < curve[0].soc:
            raise ValueError(
                f"reserve_soc {reserve_soc} lies below the charge_curve's first charge "
                f"{curve[0].soc}"
            )
        return curve


class DroneModel(DroneAbilities):
    """A type of drone."""

    model_id: DroneModelId

    def __hash__(self) -> int:
        """By what differs between the drones of a model; hashing all fields would take long."""
        return hash((self.model_id, self.power_empty_w, self.battery_j))

    @cached_property
    def charge_columns(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The charge curve's times in seconds, and its charges."""
        times_s, socs = zip(*self.charge_curve, strict=True)
        return times_s, socs

    @property
    def top_soc(self) -> float:
        """The most that this model can be charged to."""
        return self.charge_curve[-1].soc
