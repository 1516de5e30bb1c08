"""The steps of a mission as a drone receives them, with all that it needs to fly alone."""

from collections.abc import Collection
from typing import Annotated, Literal

from pydantic import Field

from skyway.contracts.message import FleetMoment, Soc
from skyway.delivery.verification import ProofMethod
from skyway.geo import Position
from skyway.ids import PackageId, StationId
from skyway.json_model import WireModel


class PackageOnBoard(WireModel):
    """A package and its mass, from which the drone computes its energy."""

    package_id: PackageId
    mass_kg: Annotated[float, Field(ge=0, description="Mass in kilograms.")]


class _FlightStep(WireModel):
    """What every step has; `step_id` counts from 1 through all revisions of the mission."""

    step_id: Annotated[
        int, Field(ge=1, description="The number of the step, from 1, through all revisions.")
    ]
    planned_start_at: FleetMoment
    planned_end_at: FleetMoment


class PickUpStep(_FlightStep):
    """Take these packages on board, not before the planned start.

    With `awaits_confirmation` it goes on until an instruction says what was `loaded`.
    """

    kind: Annotated[Literal["PICK_UP"], Field(description="Always PICK_UP.")] = "PICK_UP"
    station_id: StationId
    packages: Annotated[
        tuple[PackageOnBoard, ...], Field(description="The packages to take on board.")
    ]
    awaits_confirmation: Annotated[
        bool, Field(description="Whether the step goes on until a loader confirms.")
    ] = False


class FlyStep(_FlightStep):
    """Fly this segment; `lands` says whether the plan lands at its end or flies over."""

    kind: Annotated[Literal["FLY"], Field(description="Always FLY.")] = "FLY"
    from_id: Annotated[
        StationId, Field(alias="from", description="The station where the segment begins.")
    ]
    to_id: Annotated[
        StationId, Field(alias="to", description="The station where the segment ends.")
    ]
    from_position: Annotated[Position, Field(description="Where the segment begins, in degrees.")]
    to_position: Annotated[Position, Field(description="Where the segment ends, in degrees.")]
    length_m: Annotated[float, Field(gt=0, description="Length of the segment in metres.")]
    lands: Annotated[bool, Field(description="Whether the plan lands at its end.")]
    time_factor: Annotated[
        float,
        Field(
            gt=0,
            exclude_if=lambda value: value == 1.0,
            description="The planned time of the flight, divided by its time in still air; left "
            "out if it is 1.",
        ),
    ] = 1.0
    energy_factor: Annotated[
        float,
        Field(
            gt=0,
            exclude_if=lambda value: value == 1.0,
            description="The planned energy of the flight, divided by power × time of the flight; "
            "left out if it is 1.",
        ),
    ] = 1.0


class WaitStep(_FlightStep):
    """Stand at the station until the moment has come."""

    kind: Annotated[Literal["WAIT"], Field(description="Always WAIT.")] = "WAIT"
    station_id: StationId
    until_at: FleetMoment


class RechargeStep(_FlightStep):
    """Charge up to `until_soc` on a pad reserved for [not_before_at, not_after_at)."""

    kind: Annotated[Literal["RECHARGE"], Field(description="Always RECHARGE.")] = "RECHARGE"
    station_id: StationId
    pad: Annotated[int, Field(ge=0, description="The number of the pad, from 0.")]
    not_before_at: FleetMoment
    until_soc: Soc
    not_after_at: FleetMoment
    power_w: Annotated[
        float | None,
        Field(
            gt=0,
            exclude_if=lambda value: value is None,
            description="The power that the pad gives in watts; without a limit if missing.",
        ),
    ] = None


class AwaitedProof(WireModel):
    """A package that is handed over only once its proof is there."""

    package_id: PackageId
    method: Annotated[ProofMethod, Field(description="How the recipient proves the hand-over.")]
    upload_path: Annotated[
        str | None,
        Field(
            repr=False,
            exclude_if=lambda value: value is None,
            description="Where the drone uploads the picture of a PHOTO: a path at the gateway, "
            "valid only while the drone waits.",
        ),
    ] = None


class DeliverStep(_FlightStep):
    """Hand these packages over, which takes `dropoff_s`.

    If the recipient is absent, the drone waits `recipient_wait_s`; then the step fails:
    RECIPIENT_ABSENT. With `verification` the drone waits until HAND_OVER instructions have named
    all packages in it. After `recipient_wait_s` it hands over what needs no proof any more, and the
    step fails: RECIPIENT_ABSENT, with the `package_ids` that were handed over.
    """

    kind: Annotated[Literal["DELIVER"], Field(description="Always DELIVER.")] = "DELIVER"
    station_id: StationId
    package_ids: Annotated[tuple[PackageId, ...], Field(description="The packages to hand over.")]
    dropoff_s: Annotated[
        float, Field(ge=0, description="How long the hand-over takes, in seconds.")
    ]
    recipient_wait_s: Annotated[
        float, Field(ge=0, description="How long the drone waits for the recipient, in seconds.")
    ] = 0.0
    verification: Annotated[
        tuple[AwaitedProof, ...],
        Field(
            exclude_if=lambda value: not value,
            description="The packages that wait for a proof; left out without any.",
        ),
    ] = ()

    def proven(self, package_ids: Collection[PackageId]) -> "DeliverStep":
        """The step once the proofs of these packages are there."""
        left = tuple(each for each in self.verification if each.package_id not in package_ids)
        return self.model_copy(update={"verification": left})

    @property
    def ready_ids(self) -> tuple[PackageId, ...]:
        """The packages that wait for no proof."""
        waiting = {each.package_id for each in self.verification}
        return tuple(each for each in self.package_ids if each not in waiting)


class ReturnStep(_FlightStep):
    """Hand these packages back at the pickup station."""

    kind: Annotated[Literal["RETURN"], Field(description="Always RETURN.")] = "RETURN"
    station_id: StationId
    package_ids: Annotated[tuple[PackageId, ...], Field(description="The packages to hand back.")]


FlightStep = Annotated[
    PickUpStep | FlyStep | WaitStep | RechargeStep | DeliverStep | ReturnStep,
    Field(discriminator="kind"),
]

StepKind = Literal["PICK_UP", "FLY", "WAIT", "RECHARGE", "DELIVER", "RETURN"]


def end_of(step: FlightStep) -> StationId:
    """The station where the drone stands, or which it flies over, after this step."""
    return step.to_id if isinstance(step, FlyStep) else step.station_id


def packages_of(step: FlightStep) -> tuple[PackageId, ...]:
    """The packages that are taken on board or handed over in this step."""
    if isinstance(step, PickUpStep):
        return tuple(package.package_id for package in step.packages)
    return step.package_ids if isinstance(step, DeliverStep | ReturnStep) else ()


def awaited_ids(step: FlightStep) -> tuple[PackageId, ...]:
    """The packages that wait for a proof in this step."""
    return (
        tuple(each.package_id for each in step.verification)
        if isinstance(step, DeliverStep)
        else ()
    )
