"""A mission of a delivery, as customers, providers and operators see it."""

from datetime import datetime
from typing import Annotated

from pydantic import Field

from skyway.contracts.message import FleetMoment
from skyway.contracts.mission import LIVE_MISSION_STATES, DeliveryMission
from skyway.delivery.plan import Plan, Recharge


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
        FleetMoment | None,
        Field(description="The start as it was first booked; later plans start later."),
    ] = None

    @property
    def begins_at(self) -> datetime:
        """The start as it was first booked; promised times count from there."""
        return self.booked_start_at or self.start_at

    @property
    def is_live(self) -> bool:
        """Whether its drone still flies the mission."""
        return self.state in LIVE_MISSION_STATES
