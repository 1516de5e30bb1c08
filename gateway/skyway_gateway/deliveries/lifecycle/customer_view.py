"""A delivery as its customer sees it: it ends with the last package."""

from skyway.runtime.http.identity import Caller
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.flown_mission import FlownMission


def shown_to(caller: Caller, delivery: Delivery) -> Delivery:
    """The delivery for this caller: for customers without drones' ways home and planners' counters.

    Operators see all of it.
    """
    if caller.role != "customer" or not delivery.missions:
        return delivery
    missions = tuple(_without_the_way_home(mission) for mission in delivery.missions)
    return delivery.model_copy(update={"missions": missions})


def _without_the_way_home(mission: FlownMission) -> FlownMission:
    return mission.model_copy(
        update={
            "plan": mission.plan.model_copy(update={"stats": {}}),
            "home_plan": None,
            "home_recharge": None,
            "released_at": None,
        }
    )
