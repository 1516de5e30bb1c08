"""The SQL that keeps composition's words on missions, for a while after their end."""

from collections.abc import Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import BigInteger, Insert, Text, bindparam, delete, select
from sqlalchemy.dialects import postgresql

from skyway.contracts.mission import LIVE_MISSION_STATES, MissionReport
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_provider_registry.change_store import next_change
from skyway_provider_registry.presence.store import TOUCH
from skyway_provider_registry.tables import drones, mission_hints

#: Wall ms that an ended mission is remembered, so that a late copy of a report revives none.
_REMEMBERED_MS: Final = 24 * 3600 * 1000


async def record_reports(tx: Tx, reports: Sequence[MissionReport], *, wall_at: datetime) -> None:
    """Keep composition's words on missions that are news, and of drones of their own provider.

    What comes between two reports of the same state says the same, so keeping the first will do.
    """
    change, wall_ms = await next_change(tx), moment_to_ms(wall_at)
    words = [
        {
            "mission_id": report.mission_id,
            "about": report.drone_id,
            "of_provider": report.provider_id,
            "seq": report.seq,
            "mission_state": report.mission_state,
            "is_live": report.mission_state in LIVE_MISSION_STATES,
            "reported_wall_ms": wall_ms,
        }
        for report in reports
    ]
    await tx.execute(_KEEP_WORD, words)
    await tx.execute(TOUCH, [{"about": word["about"], "change": change} for word in words])
    before_ms = wall_ms - _REMEMBERED_MS
    ended = [
        {"about": word["about"], "before_ms": before_ms} for word in words if not word["is_live"]
    ]
    if ended:
        await tx.execute(_FORGET, ended)


def _keep_word() -> Insert:
    """An insert of composition's word, unless its drone is not the provider's, or it is no news."""
    names = ("seq", "mission_state", "is_live", "reported_wall_ms")
    values = [
        bindparam(name, type_=mission_hints.c[name].type).label(name)
        for name in ("mission_id", *names)
    ]
    own = select(drones.c.drone_id, *values).where(
        drones.c.drone_id == bindparam("about", type_=Text),
        drones.c.provider_id == bindparam("of_provider", type_=Text),
    )
    # SQLite's compiler takes it as it is: both spell ON CONFLICT the same.
    new = postgresql.insert(mission_hints).from_select(["drone_id", "mission_id", *names], own)
    is_news = (mission_hints.c.seq < new.excluded.seq) & (
        mission_hints.c.mission_state != new.excluded.mission_state
    )
    changed = {name: new.excluded[name] for name in names}
    return new.on_conflict_do_update(index_elements=["mission_id"], set_=changed, where=is_news)


# Made once: to make one takes as long as to run it.
_KEEP_WORD: Final = _keep_word()
_FORGET: Final = delete(mission_hints).where(
    mission_hints.c.drone_id == bindparam("about", type_=Text),
    mission_hints.c.is_live.is_(False),
    mission_hints.c.reported_wall_ms < bindparam("before_ms", type_=BigInteger),
)
