"""The rules of personal data: it is erased in time, and nothing is kept for longer than promised.

Whether its delivery exists is a rule of storage.
"""

from typing import Final

from skyway_gateway.deliveries.lifecycle.delivery import TERMINAL_STATES
from skyway_gateway.delivery_tables import deliveries
from skyway_gateway.tables import personal_data
from sqlalchemy import or_, select

from skyway_verifier.rule import Rule, Survey

#: The gateway looks once in a minute of wall time, at any clock rate. Fleet ms.
_ERASED_WITHIN_MS: Final = 86_400_000
#: The most days of the setting `SKYWAY_PERSONAL_DATA_DAYS`, ms.
_LONGEST_MS: Final = 36_500 * 86_400_000

_joined = personal_data.join(deliveries, deliveries.c.delivery_id == personal_data.c.delivery_id)
_kept_ms = personal_data.c.due_ms - deliveries.c.created_ms


async def _too_old(survey: Survey) -> list[str]:
    """Deliveries whose personal data is still there a day after the time that was promised."""
    if survey.fleet_ms is None:
        return []
    query = select(deliveries.c.delivery_id).select_from(_joined)
    is_late = deliveries.c.updated_ms + _kept_ms + _ERASED_WITHIN_MS < survey.fleet_ms
    is_over = deliveries.c.state.in_(sorted(TERMINAL_STATES))
    rows = await survey.rows(query.where(personal_data.c.details.is_not(None), is_over, is_late))
    return [row.delivery_id for row in rows]


PERSONAL_DATA: Final = (
    Rule(
        "personal data is erased in time",
        _too_old,
        "The gateway's loop `personal data` does not run: see its log. Erase the data: DELETE "
        "/v1/deliveries/{id}/personal-data.",
    ),
    Rule(
        "personal data is kept for a time that can be promised",
        select(deliveries.c.delivery_id)
        .select_from(_joined)
        .where(or_(_kept_ms < 0, _kept_ms > _LONGEST_MS)),
        "It is erased too early or too late. Set `due_ms` to `deliveries.created_ms` and the days "
        "of `SKYWAY_PERSONAL_DATA_DAYS` in ms.",
    ),
)
