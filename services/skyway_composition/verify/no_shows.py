"""The rules of what a provider sees: no-shows that happened, and alarms of its own missions."""

from typing import Final

from sqlalchemy import exists, select

from skyway.runtime.verification.rule import Rule
from skyway_composition.tables import alarms, missions, no_shows

NO_SHOWS: Final = (
    Rule(
        "an alarm of a mission is about its provider",
        select(alarms.c.alarm_id)
        .join(missions, missions.c.mission_id == alarms.c.mission_id)
        .where(alarms.c.provider_id != missions.c.provider_id),
        "Set `provider_id` of the alarm to that of its mission: its provider sees it then.",
    ),
    Rule(
        "a no-show is a mission of its provider that was refused or aborted",
        select(no_shows.c.mission_id).where(
            ~exists().where(
                missions.c.mission_id == no_shows.c.mission_id,
                missions.c.provider_id == no_shows.c.provider_id,
                missions.c.drone_id == no_shows.c.drone_id,
                missions.c.state.in_(("REFUSED", "ABORTED")),
            )
        ),
        "The row of `no_shows` lowers the rank of its provider without a cause: delete it.",
    ),
)
