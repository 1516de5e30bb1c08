"""The rule of windows: a mission was planned within what its request allows."""

from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Any, Final

from skyway_composition.tables import mission_steps, missions
from sqlalchemy import select

from skyway.delivery.request import DeliveryRequest, Package
from skyway.units import ms_to_moment
from skyway_verifier.composition.evidence import step_json
from skyway_verifier.rule import Rule, Survey

#: Steps are kept in whole milliseconds, windows in microseconds.
_ROUNDING: Final = timedelta(milliseconds=1)


async def _outside_their_windows(survey: Survey) -> list[str]:
    """Missions whose first plan loads, or hands over a package, when the request forbids it.

    Later revisions are left out: a plan that changes in flight may be late.
    """
    steps: dict[str, list[Any]] = defaultdict(list)
    is_hand_over = mission_steps.c.kind.in_(("PICK_UP", "DELIVER"))
    async for step in survey.each(
        select(mission_steps).where(mission_steps.c.revision == 1, is_hand_over)
    ):
        steps[step.mission_id].append(step)
    query = select(missions.c.mission_id, missions.c.request)
    return [
        row.mission_id
        async for row in survey.each(query)
        if row.mission_id in steps and _is_outside(row.request, steps[row.mission_id])
    ]


def _is_outside(text: str, steps: Iterable[Any]) -> bool:  # rows of mission_steps
    try:
        request = DeliveryRequest.read(text)
    except ValueError:
        return False  # another rule names texts that cannot be read
    packages = {each.package_id: each for each in request.packages}
    return any(
        not _loads_in_time(request, step)
        if step.kind == "PICK_UP"
        else not all(
            _delivers_in_time(packages[package_id], request, step)
            for package_id in (step_json(step) or {}).get("package_ids", ())
            if package_id in packages
        )
        for step in steps
    )


def _loads_in_time(request: DeliveryRequest, step: Any) -> bool:  # a PICK_UP
    return _is_within(step, request.earliest_pickup_at, request.latest_pickup_at)


def _delivers_in_time(package: Package, request: DeliveryRequest, step: Any) -> bool:
    return _is_within(step, package.not_before_at, package.latest_at) and _is_within(
        step, None, request.qos.deadline_at
    )


def _is_within(step: Any, earliest_at: datetime | None, latest_at: datetime | None) -> bool:
    start_at = ms_to_moment(step.planned_start_ms) + _ROUNDING
    end_at = ms_to_moment(step.planned_end_ms) - _ROUNDING
    return (earliest_at is None or earliest_at <= start_at) and (
        latest_at is None or end_at <= latest_at
    )


WINDOWS: Final = (
    Rule(
        "a mission's first plan keeps the windows and the deadline of its request",
        _outside_their_windows,
        "The request or the steps were changed. Compare `missions.request` with the request at the "
        "gateway, and the steps with `instructions.body`; inform the customer if the plan is late.",
    ),
)
