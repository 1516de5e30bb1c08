"""The SQL of webhooks' secrets: the present one, and those of rotations that are still valid."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final

from pydantic import Field, TypeAdapter
from sqlalchemy import func, or_, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import WebhookId
from skyway.json_model import JsonModel
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms
from skyway_gateway.notifications.secret_vault import read_stored_secret
from skyway_gateway.tables import webhooks


class PreviousSecret(JsonModel):
    """A secret that a rotation has replaced, encrypted, and until when it signs."""

    secret: Annotated[str, Field(repr=False)]
    until_wall_ms: int


_PREVIOUS: Final = TypeAdapter(tuple[PreviousSecret, ...])


@dataclass(frozen=True, slots=True)
class StoredSecrets:
    """What a webhook's row holds: texts as they are stored."""

    webhook_id: WebhookId
    present: str
    previous: tuple[PreviousSecret, ...]

    @classmethod
    def of(cls, row: AnyRow) -> "StoredSecrets":
        """The secrets of a row of `webhooks`."""
        previous = _PREVIOUS.validate_json(row.previous_secrets)
        return cls(row.webhook_id, row.secret, previous)

    def still_valid(self, at: datetime) -> tuple[PreviousSecret, ...]:
        """The previous secrets that sign at this moment of wall time, the newest first."""
        return tuple(each for each in self.previous if each.until_wall_ms > moment_to_ms(at))


def read_previous(text: str) -> tuple[PreviousSecret, ...]:
    """The previous secrets of a row.

    Raises
    ------
    ValueError
        The text is not a list of encrypted secrets.
    """
    previous = _PREVIOUS.validate_json(text)
    for each in previous:
        read_stored_secret(each.secret)
    return previous


async def locked_secrets(tx: Tx, webhook_id: WebhookId) -> StoredSecrets:
    """The secrets of a webhook that exists; others who change them wait."""
    this = select(webhooks).where(webhooks.c.webhook_id == webhook_id).with_for_update()
    return StoredSecrets.of((await tx.execute(this)).one())


async def put_secrets(tx: Tx, before: StoredSecrets, after: StoredSecrets) -> None:
    """Write a webhook's secrets, unless they were changed since `before` was read."""
    this = (
        webhooks.c.webhook_id == before.webhook_id,
        webhooks.c.secret == before.present,
        webhooks.c.previous_secrets == _text(before.previous),
    )
    values = {"secret": after.present, "previous_secrets": _text(after.previous)}
    await tx.execute(update(webhooks).where(*this).values(values))


async def stale_secrets(
    connection: AsyncConnection, *, prefix: str, after: str, limit: int
) -> Sequence[StoredSecrets]:
    """Webhooks after this id whose secrets do not begin with the prefix, or have previous ones."""
    begins = func.substr(webhooks.c.secret, 1, len(prefix)) == prefix
    statement = (
        select(webhooks)
        .where(webhooks.c.webhook_id > after, or_(~begins, webhooks.c.previous_secrets != "[]"))
        .order_by(webhooks.c.webhook_id)
        .limit(limit)
    )
    return [StoredSecrets.of(row) for row in await connection.execute(statement)]


def _text(previous: tuple[PreviousSecret, ...]) -> str:
    return json.dumps([each.model_dump() for each in previous])
