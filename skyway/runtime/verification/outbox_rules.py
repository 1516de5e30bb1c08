"""The rules of an outbox: each message has a receiver that is known, and is sent within minutes."""

from collections.abc import Collection
from typing import Final

from sqlalchemy import Table, select

from skyway.runtime.verification.rule import Finder, Rule
from skyway.runtime.verification.storage_rules import name_of
from skyway.runtime.verification.survey import Survey

#: Senders wait a minute at most before they send a message again; clocks may differ. Wall ms.
_LONGEST_WAIT_MS: Final = 600_000


def outbox_rules(outbox: Table, *, channels: Collection[str]) -> tuple[Rule, ...]:
    """The rules of the outbox of a service that sends on these channels."""
    return (
        Rule(
            "a message in the outbox is sent again within ten minutes",
            _waiting_too_long(outbox),
            "The message and all later ones of its stream wait. Set `due_at_ms` of this row to 0. "
            "Check the clocks of all machines.",
        ),
        Rule(
            "a message in the outbox has a receiver",
            select(outbox.c.id).where(outbox.c.channel.not_in(sorted(channels))),
            f"Nobody sends this message: `channel` must be one of {', '.join(sorted(channels))}. "
            "Correct it: `address` shows a topic of MQTT or a path of a service.",
        ),
    )


def _waiting_too_long(outbox: Table) -> Finder:
    async def find(survey: Survey) -> list[str]:
        latest_ms = survey.wall_ms + _LONGEST_WAIT_MS
        query = select(outbox.c.id).where(outbox.c.due_at_ms > latest_ms)
        return [name_of(outbox, row.id) for row in await survey.rows(query)]

    return find
