"""The rules of hints and change numbers, by which candidates are selected."""

from typing import Final

from sqlalchemy import and_, func, literal, or_, select

from skyway.contracts.mission import LIVE_MISSION_STATES
from skyway.runtime.verification.rule import Rule
from skyway_provider_registry.change_store import ONLY_ROW
from skyway_provider_registry.tables import changes, mission_hints, presence

_newest_change = select(func.coalesce(func.max(presence.c.changed), 0)).scalar_subquery()
_rows = select(func.count()).select_from(changes).scalar_subquery()

_SETTLES: Final = (
    "Composition decides which drones are busy (GET /v1/missions?drone_id=...). Set `is_live` and "
    "`mission_state` to the state of the mission there, and `presence.changed` of the drone to a "
    "new number of `changes.latest`."
)

HINTS: Final = (
    Rule(
        "a hint is live while its mission is",
        select(mission_hints.c.mission_id).where(
            mission_hints.c.is_live != mission_hints.c.mission_state.in_(LIVE_MISSION_STATES)
        ),
        _SETTLES,
    ),
    Rule(
        "a hint says when, where and with what charge its drone is free, or nothing",
        select(mission_hints.c.mission_id).where(
            or_(
                mission_hints.c.free_ms.is_(None) != mission_hints.c.free_station_id.is_(None),
                mission_hints.c.free_ms.is_(None) != mission_hints.c.free_soc.is_(None),
                ~mission_hints.c.free_soc.between(0, 1),
            )
        ),
        "Set `free_ms`, `free_station_id` and `free_soc` to NULL: the drone counts as busy until "
        "the mission's next report, or its end.",
    ),
    Rule(
        "the change numbers are not behind the changes",
        select(literal("changes")).where(
            or_(
                and_(_newest_change > 0, _rows == 0),
                select(func.count())
                .select_from(changes)
                .where(
                    or_(
                        changes.c.only != ONLY_ROW,
                        changes.c.latest < _newest_change,
                        changes.c.latest < changes.c.providers,
                        changes.c.latest < changes.c.removals,
                    )
                )
                .scalar_subquery()
                > 0,
            )
        ),
        "Readers that have seen a larger number miss all changes up to it. Set `changes.latest` to "
        "more than every `presence.changed`, and restart the registry.",
    ),
)
