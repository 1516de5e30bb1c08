"""Parts of a delivery as people see it: its missions, who refused it, and how it waits."""

from collections.abc import Iterable
from datetime import datetime
from typing import Annotated

from pydantic import Field

from skyway.contracts.candidate import FREE_AT, ProviderReason
from skyway.contracts.message import FleetMoment
from skyway.contracts.mission import LIVE_MISSION_STATES, DeliveryMission
from skyway.delivery.offer import Price
from skyway.delivery.plan import Plan, Recharge
from skyway.ids import DroneId, ProviderId
from skyway.json_model import JsonModel


class FlownMission(DeliveryMission):
    """A mission of a delivery; for customers it ends with the last delivery.

    `home_plan`, `home_recharge` and `released_at` say what the drone does then. Documents for
    customers leave them out.
    """

    home_plan: Annotated[
        Plan | None,
        Field(
            exclude_if=lambda value: value is None,
            description="How the drone flies to where it stands by, after the end of `plan`; not "
            "for customers.",
        ),
    ] = None
    home_recharge: Annotated[
        Recharge | None,
        Field(
            exclude_if=lambda value: value is None,
            description="How it is charged there; seconds count from the end of `plan`; not for "
            "customers.",
        ),
    ] = None
    released_at: Annotated[
        FleetMoment | None,
        Field(
            exclude_if=lambda value: value is None,
            description="When the drone is planned to be free again; not for customers.",
        ),
    ] = None
    is_replanning: Annotated[
        bool, Field(description="Whether its plan no longer holds and there is no new plan yet.")
    ] = False
    booked_start_at: Annotated[
        FleetMoment,
        Field(
            description="The start as it was first booked, from which promised times count; later "
            "plans start later."
        ),
    ]
    charged: Annotated[
        Price | None,
        Field(
            description="What the customer pays: `price`, less what the terms give back. Null "
            "until nothing will happen to its packages any more."
        ),
    ] = None

    @property
    def owed(self) -> Price:
        """What the customer pays, as known now."""
        return self.price if self.charged is None else self.charged

    @property
    def is_live(self) -> bool:
        """Whether its drone still flies the mission."""
        return self.state in LIVE_MISSION_STATES


class Refusal(JsonModel):
    """A drone that refused to fly the delivery, and why."""

    attempt: Annotated[int, Field(description="The booking attempt of the refused mission.")]
    provider_id: Annotated[ProviderId, Field(description="The provider of the drone.")]
    drone_id: Annotated[DroneId, Field(description="The drone, which is not asked again.")]
    code: Annotated[str | None, Field(description="Why the drone refused, for programs.")]
    detail: Annotated[str | None, Field(description="Why the drone refused, in words.")]
    pickup_at: Annotated[
        FleetMoment | None,
        Field(
            exclude_if=lambda value: value is None,
            description="When the drone would have begun to load, if its pickup was not that of "
            "the request: no other drone loads before this moment.",
        ),
    ] = None


class Waiting(JsonModel):
    """A request that could not be booked yet, because no drone that could fly it was free."""

    place: Annotated[
        int,
        Field(
            ge=1,
            description="Its place among the waiting requests of its class and network, by the "
            "moment of asking; 1 is next.",
        ),
    ]
    since_at: FleetMoment
    earliest_start_at: Annotated[
        FleetMoment | None,
        Field(
            description="When the first of the drones that were asked is free for another mission; "
            "null if that is not known."
        ),
    ] = None

    @staticmethod
    def earliest_start(reasons: Iterable[ProviderReason]) -> FleetMoment | None:
        """The earliest moment that the reasons of a booking round name."""
        return min(
            (
                datetime.fromisoformat(each.data[FREE_AT])
                for each in reasons
                if each.code == "BUSY" and FREE_AT in each.data
            ),
            default=None,
        )
