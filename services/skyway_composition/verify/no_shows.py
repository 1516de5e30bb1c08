"""The rule of no-shows: a provider is blamed only for a mission that its drone did not fly."""

from typing import Final

from sqlalchemy import exists, select

from skyway.runtime.verification.rule import Rule
from skyway_composition.tables import missions, no_shows

NO_SHOWS: Final = (
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
