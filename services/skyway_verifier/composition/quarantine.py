"""The rule of the quarantine: each row is shown as it arrived."""

import hashlib
from typing import Any, Final

from skyway_composition.quarantine.quarantined import MOST_PAYLOAD_BYTES
from skyway_composition.quarantine.store import quarantined
from skyway_composition.tables import quarantine
from sqlalchemy import select

from skyway_verifier.finders import rows_where
from skyway_verifier.rule import Rule


def _is_damaged(row: Any) -> bool:  # a row of quarantine
    try:
        shown = quarantined(row)
    except (ValueError, OverflowError):
        return True
    is_hash = hashlib.sha256(row.payload).hexdigest() == row.payload_sha256
    return (
        len(row.payload) != min(row.size_bytes, MOST_PAYLOAD_BYTES)
        or not (is_hash or not shown.is_whole)
        or f"/{row.provider_id}/{row.drone_id}/" not in row.topic
        or row.times < 1
        or row.first_ms > row.last_ms
    )


QUARANTINE: Final = (
    Rule(
        "a set-aside message is shown as it arrived",
        rows_where(select(quarantine), _is_damaged, "quarantine_id"),
        "The message was never taken, so nothing depends on its row. Delete it: DELETE "
        "/v1/quarantine/{quarantine_id}.",
    ),
)
