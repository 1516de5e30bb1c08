"""The broker accounts of customers and operators, which come and end with their keys."""

import asyncio
import secrets
from typing import Final, Protocol

from skyway.contracts.broker_rules import AccountRole, operator_account
from skyway.ids import ProviderId, SubjectId
from skyway.runtime.http.identity import Caller
from skyway.runtime.sql.database import Database
from skyway_gateway.access import account_store
from skyway_gateway.access.api_key import ApiKey, BrokerLogin, IssuedKey, NewKey

_PASSWORD_BYTES: Final = 24


class Accounts(Protocol):
    """The registry, which knows providers, and opens and closes broker accounts of people."""

    async def has_provider(self, provider_id: ProviderId, *, caller: Caller) -> bool:
        """Whether this provider is registered."""
        ...

    async def open_account(self, role: AccountRole, name: SubjectId, *, password: str) -> None:
        """Open an account, or give it another password."""
        ...

    async def close_account(self, role: AccountRole, name: SubjectId) -> None:
        """Close an account; an account that does not exist is closed already."""
        ...


class BrokerAccounts:
    """Has the registry open and close accounts; one at a time, so that the last change stays."""

    def __init__(self, db: Database, registry: Accounts) -> None:
        self._db = db
        self._registry = registry
        self._turn = asyncio.Lock()

    async def open(self, issued: IssuedKey) -> None:
        """Have the registry open the account, unless it has this key's password already.

        A repeated answer must not restore a password that a later key has replaced.

        Raises
        ------
        ServiceUnavailable
            The registry is away: repeat the call.
        """
        if issued.mqtt is None or issued.role == "provider":
            return
        async with self._turn:
            async with self._db.read() as connection:
                if await account_store.is_account_open(connection, issued.key_id):
                    return
            name, password = issued.subject_id, issued.mqtt.password
            await self._registry.open_account(issued.role, name, password=password)
            async with self._db.write() as tx:
                await account_store.account_is_open(tx, issued.role, name, key_id=issued.key_id)

    async def close_orphaned(self) -> None:
        """Close the accounts whose password came with a key that has ended, or of ended keys."""
        async with self._turn:
            async with self._db.read() as connection:
                orphaned = await account_store.orphaned_accounts(connection)
            for role, subject_id in orphaned:
                await self._registry.close_account(role, subject_id)
                async with self._db.write() as tx:
                    await account_store.account_is_closed(tx, role, subject_id)


def new_login(key: NewKey | ApiKey) -> BrokerLogin | None:
    """The account that a new key gives its holder, with a new password; None if it gives none."""
    scopes, name = key.scopes, key.subject_id
    if key.role == "operator" and scopes is None:
        # The account reads everything, so a key with fewer scopes does not have one.
        user_name = operator_account(name)
    elif key.role == "customer" and (scopes is None or "deliveries:read" in scopes):
        user_name = name
    else:
        return None
    return BrokerLogin(user_name=user_name, password=secrets.token_urlsafe(_PASSWORD_BYTES))
