"""The rules of missions as the gateway stores them."""

import json
from datetime import datetime
from typing import Any, Final

from sqlalchemy import and_, exists, or_, select

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.runtime.verification.rule import Rule
from skyway.runtime.verification.survey import Survey
from skyway.units import moment_to_ms
from skyway_gateway.tables import deliveries, missions

#: The columns that `missions.body` repeats.
_REPEATED: Final = ("mission_id", "delivery_id", "attempt", "trip", "provider_id", "drone_id")

_HAVE_ENDED: Final = ("COMPLETED", "ABORTED", "CANCELLED")


async def _other_than_body(survey: Survey) -> list[str]:
    return [row.mission_id async for row in survey.each(select(missions)) if _differs(row)]


def _differs(row: Any) -> bool:  # a row of missions
    body = json.loads(row.body)
    price, begun_at = body["price"], body.get("booked_start_at") or body["start_at"]
    return (
        any(body[name] != getattr(row, name) for name in _REPEATED)
        or (price["amount"], price["currency"]) != (row.price_amount, row.currency)
        or row.start_ms not in (None, moment_to_ms(datetime.fromisoformat(begun_at)))
    )


MISSIONS: Final = (
    Rule(
        "a mission's columns say what its body says",
        _other_than_body,
        "Composition has the same mission (GET /v1/missions/{id}): correct the value that differs. "
        "Earnings and statistics read the columns.",
    ),
    Rule(
        "a mission that is over has its end",
        select(missions.c.mission_id).where(
            or_(
                and_(missions.c.state.in_(_HAVE_ENDED), missions.c.ended_ms.is_(None)),
                and_(missions.c.state.in_(LIVE_MISSION_STATES), missions.c.ended_ms.is_not(None)),
            )
        ),
        "Composition knows whether the mission is over (GET /v1/missions/{id}): correct `state` or "
        "`ended_ms`.",
    ),
    Rule(
        "a mission belongs to an attempt that was made",
        select(missions.c.mission_id).where(
            or_(
                missions.c.trip < 1,
                missions.c.attempt < 1,
                ~exists().where(
                    and_(
                        deliveries.c.delivery_id == missions.c.delivery_id,
                        deliveries.c.attempt >= missions.c.attempt,
                    )
                ),
            )
        ),
        "A lower `deliveries.attempt` than that of a mission makes booking repeat an attempt, and "
        "composition answers with the old missions. Set it to one more than the last attempt.",
    ),
)
