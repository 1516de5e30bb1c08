"""API keys: issued, rotated and deleted, with the broker accounts that belong to them."""

import asyncio
import secrets
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import Final, Protocol

from skyway.contracts.broker_rules import (
    ACCOUNT_ROLES,
    DEPLOYMENT_OPERATOR,
    AccountRole,
    operator_account,
)
from skyway.errors import InvalidInput
from skyway.ids import KeyId, ProviderId, SubjectId, is_live_account
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import AccessDenied, Conflict, Unauthenticated
from skyway.runtime.http.identity import Caller, KeyHolder
from skyway.runtime.idempotency_store import Answer, KeyedCall, once
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.peer_secrets import read_secret, secret_hash
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.access import account_store, store
from skyway_gateway.access.api_key import (
    ApiKey,
    BrokerLogin,
    IssuedKey,
    KeyRequest,
    KeyRole,
    NewKey,
)
from skyway_gateway.access.recognise import CachedKeys
from skyway_gateway.access.usage import UsageQuota

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
    if not is_live_account(name):
        return None  # events of test accounts are not sent over MQTT
    if key.role == "operator" and scopes is None:
        # The account reads everything, so a key with fewer scopes does not have one.
        user_name = operator_account(name)
    elif key.role == "customer" and (scopes is None or "deliveries:read" in scopes):
        user_name = name
    else:
        return None
    return BrokerLogin(user_name=user_name, password=secrets.token_urlsafe(_PASSWORD_BYTES))


#: How secrets of live keys and of test keys begin, so that people see which one they have.
_LIVE_PREFIX: Final = "sk_live_"
_TEST_PREFIX: Final = "sk_test_"
#: 256 bits cannot be guessed, so a fast hash is enough.
_SECRET_BYTES: Final = 32

#: Accounts of Skyway's own processes, and how the names of drones' accounts begin.
_RESERVED_NAMES: Final = frozenset({"operator", "gateway", "registry", "composition"})
_DRONE_PREFIX: Final = "drn_"

#: The keys that a deployment starts with: file in the secrets folder, role, subject.
_FIRST_KEYS: Final[tuple[tuple[str, KeyRole, str], ...]] = (
    ("operator_key", "operator", "operator"),
    ("customer_key", "customer", "newcomer"),
)
#: The holders of these keys: no call has made them.
FIRST_HOLDERS: Final = frozenset((role, subject_id) for _, role, subject_id in _FIRST_KEYS)

#: How long a key that was rotated lasts if the next key is not used, wall time.
_OVERLAP: Final = timedelta(days=1)


def _new_secret(subject_id: SubjectId) -> str:
    """A new API key of this subject."""
    prefix = _LIVE_PREFIX if is_live_account(subject_id) else _TEST_PREFIX
    return prefix + secrets.token_urlsafe(_SECRET_BYTES)


class Keys:
    """The API keys of this deployment."""

    def __init__(
        self,
        db: Database,
        *,
        cached: CachedKeys,
        accounts: Accounts,
        secrets_dir: Path,
        clock: FleetClock,
        mint: Mint,
        most_per_subject: int,
    ) -> None:
        self._most_per_subject = most_per_subject
        self._db = db
        self._cached = cached
        self._accounts = accounts
        self._broker = BrokerAccounts(db, accounts)
        self._secrets_dir = secrets_dir
        self._clock = clock
        self._mint = mint
        #: Set when `close_orphaned_accounts` has something to do.
        self.wake = Wake()

    async def make_first_keys(self) -> None:
        """Add the keys whose secrets are in the secrets folder, unless they were added before.

        A key that an operator has deleted stays deleted; another secret in the file is another key.
        """
        async with self._db.write() as tx:
            for name, role, subject_id in _FIRST_KEYS:
                if (self._secrets_dir / name).exists():
                    secret = read_secret(self._secrets_dir, name)
                    key = self._key(NewKey(role=role, subject_id=SubjectId(subject_id)))
                    await store.add_if_new(tx, key, key_hash=secret_hash(secret))

    async def issue(self, holder: KeyHolder, asked: KeyRequest, call: KeyedCall) -> Answer:
        """A new key, with a broker account for people; only this answer shows the secrets.

        Raises
        ------
        InvalidInput
            The customer's name is reserved for Skyway's own processes or for drones, no such
            provider is registered, or the expiry is past or too far ahead.
        AccessDenied
            The key would have more scopes or a later end than the holder's own, or the holder may
            not make it.
        Conflict
            TOO_MANY_KEYS: so many keys of the subject are in use.
        ServiceUnavailable
            The registry could not open the account: repeat the call.
        """
        caller = holder.caller
        if not is_live_account(caller.subject_id):
            raise AccessDenied("a test key makes no keys: use a live key of its customer")
        requested = asked.asked_by(caller.role, caller.subject_id)
        requested.refuse_unless_within(holder)
        if _is_reserved(requested):
            detail = f"{requested.subject_id!r} is reserved for Skyway's own processes"
            raise InvalidInput("subject_id", detail)
        await self._must_be_registered(requested, caller)

        async def write(tx: Tx) -> Answer:
            requested.refuse_bad_end(self._clock.wall_now())
            await self._refuse_too_many(tx, requested.role, requested.subject_id)
            issued = await self.add(tx, requested)
            location = {"Location": f"/v1/keys/{issued.key_id}"}
            return Answer(201, issued.model_dump_json().encode(), location)

        answer = await once(self._db, call, act=write, clock=self._clock)
        await self._broker.open(IssuedKey.read(answer.body))
        return answer

    async def _must_be_registered(self, requested: NewKey, caller: Caller) -> None:
        if requested.role != "provider":
            return
        provider_id = ProviderId(requested.subject_id)
        if not await self._accounts.has_provider(provider_id, caller=caller):
            raise InvalidInput("subject_id", f"no provider {provider_id!r} is registered")

    async def usage(self, caller: Caller) -> Sequence[UsageQuota]:
        """How many keys the caller has; drones have one."""
        if caller.role not in ("customer", "provider", "operator"):
            return ()
        async with self._db.read() as connection:
            now = self._clock.wall_now()
            used = await store.used(connection, caller.role, SubjectId(caller.subject_id), at=now)
        return (UsageQuota(code="TOO_MANY_KEYS", most=self._most_per_subject, used=used),)

    async def _refuse_too_many(self, tx: Tx, role: KeyRole, subject_id: SubjectId) -> None:
        most, now = self._most_per_subject, self._clock.wall_now()
        if await store.used(tx.connection, role, subject_id, at=now) >= most:
            raise Conflict("TOO_MANY_KEYS", f"{subject_id} has {most} keys: delete one first")

    async def add(self, tx: Tx, requested: NewKey) -> IssuedKey:
        """A new key, added in this transaction."""
        key, secret = self._key(requested), _new_secret(requested.subject_id)
        is_open = requested.role not in ACCOUNT_ROLES
        await store.add(tx, key, key_hash=secret_hash(secret), is_account_open=is_open)
        return IssuedKey(**dict(key), key=secret, mqtt=new_login(requested))

    async def rotate(self, holder: KeyHolder, call: KeyedCall) -> Answer:
        """The next key of a key, with the same name, scopes and expiry; shown only in this answer.

        The present key ends when the next one is first used, at the latest after a day. Another
        rotation before that replaces the next key. The broker account gets a new password now,
        unless it has the password of another key that has not ended.

        Raises
        ------
        Unauthenticated
            The key has ended meanwhile.
        ServiceUnavailable
            The registry could not change the account: repeat the call.
        """
        caller, key_id = holder.caller, KeyId(holder.key_id)
        if caller.role not in ("customer", "provider", "operator"):
            raise Unauthenticated
        role: KeyRole = caller.role

        async def write(tx: Tx) -> Answer:
            now = self._clock.wall_now()
            old = await store.begin_rotation(tx, key_id, at=now, until=now + _OVERLAP)
            if old is None:
                raise Unauthenticated
            key = ApiKey(
                key_id=KeyId(self._mint("key")),
                role=role,
                subject_id=SubjectId(caller.subject_id),
                name=old.name,
                scopes=old.scopes,
                created_wall_at=now,
                expires_wall_at=old.expires_at,
                replaces=key_id,
            )
            secret = _new_secret(key.subject_id)
            login = await self._next_login(tx, key, replaces=key_id)
            await store.add(
                tx,
                key,
                key_hash=secret_hash(secret),
                is_account_open=old.is_account_open and login is None,
                is_next=True,
            )
            issued = IssuedKey(**dict(key), key=secret, mqtt=login)
            tx.after_commit(self._cached.forget)
            return Answer(201, issued.model_dump_json().encode())

        answer = await once(self._db, call, act=write, clock=self._clock)
        await self._broker.open(IssuedKey.read(answer.body))
        return answer

    async def _next_login(self, tx: Tx, key: ApiKey, *, replaces: KeyId) -> BrokerLogin | None:
        """The login for a next key, with a new password; None if another key's is valid."""
        is_kept = await account_store.has_password_of_other_key(
            tx.connection, key.role, key.subject_id, key_id=replaces
        )
        return None if is_kept else new_login(key)

    async def delete(self, caller: Caller, key_id: KeyId) -> None:
        """Delete a key; a broker account with the password of this key ends, too.

        Raises
        ------
        NotFound
            There is no such key, or it is not the caller's.
        AccessDenied
            It is the customer's own live key, which an operator deletes.
        """
        async with self._db.write() as tx:
            if caller.role == "customer":
                at = self._clock.wall_now()
                found = await store.one(tx.connection, caller, key_id, at=at)
                if found.livemode:
                    raise AccessDenied("an operator deletes live keys")
            await store.delete(tx, key_id, at=self._clock.wall_now())
            tx.after_commit(self._cached.forget)
        self.wake.set()

    async def end_expired_keys(self) -> bool:
        """One step of the loop: end the keys whose time is over."""
        async with self._db.read() as connection:
            has_expired = await store.has_expired(connection, at=self._clock.wall_now())
        if has_expired:
            async with self._db.write() as tx:
                await store.end_expired(tx, at=self._clock.wall_now())
                tx.after_commit(self._cached.forget)
            self.wake.set()
        return False

    async def close_orphaned_accounts(self) -> bool:
        """One step of the loop: close the broker accounts whose key has ended."""
        await self._broker.close_orphaned()
        return False

    def _key(self, requested: NewKey) -> ApiKey:
        return ApiKey(
            key_id=KeyId(self._mint("key")),
            **requested.model_dump(),
            created_wall_at=self._clock.wall_now(),
        )


def _is_reserved(requested: NewKey) -> bool:
    name = requested.subject_id
    match requested.role:
        case "customer":
            return name in _RESERVED_NAMES or name.startswith(_DRONE_PREFIX)
        case "operator":
            return operator_account(name) == DEPLOYMENT_OPERATOR
        case "provider":
            return False
