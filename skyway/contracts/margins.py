"""What a booked plan has on top of what it needs, and what its energy margin is made of."""

from typing import Annotated, Literal

from pydantic import Field

from skyway.delivery.lateness import KnownAir
from skyway.ids import StationId
from skyway.json_model import WireModel


class RiskMargin(WireModel):
    """What the energy margin of a plan is made of, if it follows from a network's `reserve_risk`.

    The three deviations are independent, so together they are the root of the sum of their
    squares. `flight_margin` covers `deviations` times this root, within 0.05 and 0.40. The values
    are those of the flight with the largest margin, which leads from `from` to `to`; both are null
    if the plan has no flight, or if this flight carries only packages of others.
    """

    reserve_risk: Annotated[
        float, Field(description="The accepted share of landings below the reserve.")
    ]
    deviations: Annotated[
        float, Field(description="How many standard deviations the margin covers.", examples=[3.09])
    ]
    wind_deviation: Annotated[
        float | None,
        Field(
            description="Standard deviation of the energy by the error of the wind, as a share; "
            "null if the drone could not fly in a wind that is so wrong."
        ),
    ]
    use_deviation: Annotated[
        float,
        Field(
            description="Standard deviation of the energy by the drone's energy use, which changes "
            "from flight to flight."
        ),
    ]
    model_deviation: Annotated[
        float,
        Field(
            description="Standard deviation of the energy by what the model of a drone leaves out."
        ),
    ]
    flight_margin: Annotated[
        float, Field(ge=0, description="The margin of the flight, as a share of its energy.")
    ]
    limited_by: Annotated[
        Literal["LEAST", "MOST"] | None,
        Field(
            description="LEAST: the least margin counts, since the risk asks for less. MOST: the "
            "largest margin counts, and the risk is larger than accepted."
        ),
    ] = None
    from_id: Annotated[
        StationId | None, Field(alias="from", description="Where the flight begins.")
    ] = None
    to_id: Annotated[StationId | None, Field(alias="to", description="Where it ends.")] = None


class Margins(WireModel):
    """The margins of a booked plan: a share of energy, and time between drones.

    The plan's energies hold `energy_margin` already; each pad is reserved `pad_gap_s` longer than
    its session. A drone that is later than `tolerated_lateness_s` gets a new plan if the delay
    costs something.
    """

    energy_margin: Annotated[
        float,
        Field(
            ge=0,
            description="Energy on top of what flights need, as a share. With `risk` and a "
            "forecast it does not cover the error of the wind: `energy_factor` of flights does.",
        ),
    ] = 0.0
    pad_gap_s: Annotated[float, Field(ge=0, description="Seconds between two drones on a pad.")] = (
        0.0
    )
    tolerated_lateness_s: Annotated[
        float,
        Field(ge=0, description="Seconds that a drone may be late before it gets a new plan."),
    ] = 0.0
    risk: Annotated[
        RiskMargin | None,
        Field(
            exclude_if=lambda value: value is None,
            description="What the energy margin is made of; left out if it is a constant of the "
            "network.",
        ),
    ] = None
    late_share: Annotated[
        float | None,
        Field(
            ge=0,
            exclude_if=lambda value: value is None,
            description="How late the wind makes a package in nine of ten cases, at most, as a "
            "share of the planned time: by the error of the forecast or of the measured wind. The "
            "P90 uses it until enough lateness is learned. Left out if no wind is known.",
        ),
    ] = None
    air: Annotated[
        KnownAir | None,
        Field(
            exclude_if=lambda value: value is None,
            description="What was known of the air when the plan was made; the P90 is learned from "
            "packages in air like this. Left out if nothing was known.",
        ),
    ] = None
