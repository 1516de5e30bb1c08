"""Encrypts the stored secrets that the first key has not encrypted yet.

It runs at the start, because the keys may have been changed, and again from time to time. Each row
is written only if it is as it was read: replicas may do the same concurrently, and a process that
ends in between leaves rows that can be read, old or new.
"""

import logging
from dataclasses import replace
from datetime import datetime
from typing import Final

from skyway.ids import WebhookId
from skyway.runtime.sql.database import Database
from skyway_gateway.notifications.secret_store import (
    PreviousSecret,
    StoredSecrets,
    put_secrets,
    stale_secrets,
)
from skyway_gateway.notifications.secret_vault import KEYS_FILE, SecretVault, UnreadableSecret

log = logging.getLogger(__name__)

#: Rows that are read and written together.
_TOGETHER: Final = 500
#: The most webhooks that an error names.
_NAMED: Final = 10


async def seal_secrets(db: Database, vault: SecretVault, *, at: datetime) -> list[WebhookId]:
    """Encrypt with the first key, and drop previous secrets whose time is over.

    The result is the webhooks with a secret that cannot be decrypted; the log names them.

    Raises
    ------
    InvalidSettings
        The file of keys is missing, or holds something else.
    """
    unreadable: list[WebhookId] = []
    after = ""
    while True:
        async with db.read() as connection:
            found = await stale_secrets(
                connection, prefix=vault.prefix, after=after, limit=_TOGETHER
            )
        if not found:
            break
        after = found[-1].webhook_id
        changes = []
        for before in found:
            now, is_readable = _sealed(vault, before, at)
            if not is_readable:
                unreadable.append(before.webhook_id)
            if now != before:
                changes.append((before, now))
        if changes:
            async with db.write() as tx:
                for before, now in changes:
                    await put_secrets(tx, before, now)
    if unreadable:
        log.error(
            "secrets of webhooks cannot be decrypted: the file %s in SKYWAY_SECRETS_DIR lacks "
            "their key. Put the key back as a line of the file, or have the customers get other "
            "secrets",
            KEYS_FILE,
            extra={"webhooks": len(unreadable), "first": unreadable[:_NAMED]},
        )
    return unreadable


def _sealed(vault: SecretVault, stored: StoredSecrets, at: datetime) -> tuple[StoredSecrets, bool]:
    """The secrets as they are to be stored, and whether all could be decrypted."""
    webhook_id = stored.webhook_id
    present, is_readable = _resealed(vault, stored.present, webhook_id)
    previous: list[PreviousSecret] = []
    for each in stored.still_valid(at):
        secret, is_good = _resealed(vault, each.secret, webhook_id)
        previous.append(each.model_copy(update={"secret": secret}))
        is_readable &= is_good
    return replace(stored, present=present, previous=tuple(previous)), is_readable


def _resealed(vault: SecretVault, stored: str, webhook_id: WebhookId) -> tuple[str, bool]:
    if stored.startswith(vault.prefix):
        return stored, True
    try:
        return vault.seal(vault.open(stored, webhook_id), webhook_id), True
    except UnreadableSecret:
        return stored, False
