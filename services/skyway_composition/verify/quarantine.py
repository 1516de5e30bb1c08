"""The rule of the quarantine: each row is shown as it arrived."""

import hashlib
from typing import Any, Final

from sqlalchemy import select

from skyway.runtime.verification.rule import Rule, Survey
from skyway_composition.quarantine.quarantined import MOST_PAYLOAD_BYTES
from skyway_composition.quarantine.store import quarantined
from skyway_composition.tables import quarantine


async def _damaged(survey: Survey) -> list[str]:
    rows = survey.each(select(quarantine))
    return [row.quarantine_id async for row in rows if not _is_sound(row)]


def _is_sound(row: Any) -> bool:  # a row of quarantine
    try:
        shown = quarantined(row)
    except (ValueError, OverflowError):
        return False
    is_hash = hashlib.sha256(row.payload).hexdigest() == row.payload_sha256
    return (
        len(row.payload) == min(row.size_bytes, MOST_PAYLOAD_BYTES)
        and (is_hash or not shown.is_whole)
        and f"/{row.provider_id}/{row.drone_id}/" in row.topic
        and row.times >= 1
        and row.first_ms <= row.last_ms
    )


QUARANTINE: Final = (
    Rule(
        "a set-aside message is shown as it arrived",
        _damaged,
        "The message was never taken, so nothing depends on its row. Delete it: DELETE "
        "/v1/quarantine/{quarantine_id}.",
    ),
)
