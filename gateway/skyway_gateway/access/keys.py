"""API keys: issued and deleted with the broker accounts that belong to them, and recognised.

A busy caller shows its key with each request, so a key is looked up twice a second at most. A key
that this process deletes stops immediately; a key that another replica deletes stops within half a
second.
"""

import hashlib
import secrets
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path
from typing import Final, Protocol

from skyway.contracts.drone_key import DRONE_KEY_PREFIX
from skyway.errors import InvalidInput
from skyway.ids import DroneId, KeyId, ProviderId, SubjectId
from skyway.runtime.answer_cache import AnswerCache
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict
from skyway.runtime.http.identity import Caller, read_secret
from skyway.runtime.idempotency import Answer, once
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.access import store
from skyway_gateway.access.store import ApiKey, BrokerLogin, IssuedKey, KeyRole, NewKey
from skyway_gateway.access.usage import UsageQuota

#: How long a caller is cached, wall time.
_KEPT: Final = timedelta(seconds=0.5)
_MOST_CACHED: Final = 10_000

_PREFIX: Final = "sk_"
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


def _new_secret() -> str:
    """A new API key."""
    return _PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def secret_hash(secret: str) -> str:
    """The hash of an API key: it is stored instead of the key, and finds a shown key."""
    return hashlib.sha256(secret.encode()).hexdigest()


class CachedKeys:
    """Recognises keys of customers, providers and operators; unknown keys are never cached."""

    def __init__(self, db: Database, clock: FleetClock) -> None:
        self._db = db
        self._cached = AnswerCache(self._look_up, clock=clock, kept=_KEPT, most=_MOST_CACHED)

    async def caller_of(self, secret: str) -> Caller | None:
        """The caller with this key; None when the key is unknown or deleted."""
        key_hash = secret_hash(secret)
        return self._cached.cached(key_hash) or await self._cached.ask(key_hash)

    def forget(self) -> None:
        """Empty the cache, because a key was deleted."""
        self._cached.clear()

    async def _look_up(self, key_hash: str) -> Caller | None:
        async with self._db.read() as connection:
            return await store.caller_of(connection, key_hash)


class DroneKeyRegistry(Protocol):
    """The registry, which issues the keys of drones."""

    async def drone_of(self, key_hash: str) -> DroneId | None:
        """The drone with this key; None when the key is unknown or no longer valid."""
        ...


class DroneKeys:
    """Recognises keys of drones; the registry is asked each time, so a revoked key stops."""

    def __init__(self, registry: DroneKeyRegistry) -> None:
        self._registry = registry

    async def caller_of(self, secret: str) -> Caller | None:
        """The drone that calls; None when the key is unknown or no longer valid."""
        drone_id = await self._registry.drone_of(secret_hash(secret))
        return None if drone_id is None else Caller("drone", drone_id)


class AllKeys:
    """The keys of all callers; how a key begins says whose it is."""

    def __init__(self, people: CachedKeys, drones: DroneKeys) -> None:
        self._people = people
        self._drones = drones

    async def caller_of(self, secret: str) -> Caller | None:
        """The caller with this key; None when the key is unknown or no longer valid."""
        is_drones = secret.startswith(DRONE_KEY_PREFIX)
        return await (self._drones if is_drones else self._people).caller_of(secret)


class Accounts(Protocol):
    """The registry, which knows providers, and opens and closes broker accounts of customers."""

    async def has_provider(self, provider_id: ProviderId, *, caller: Caller) -> bool:
        """Whether this provider is registered."""
        ...

    async def open_account(self, user_name: SubjectId, *, password: str) -> None:
        """Open an account, or give it another password."""
        ...

    async def close_account(self, user_name: SubjectId) -> None:
        """Close an account; an account that does not exist is closed already."""
        ...


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
                    key = self._key(role, SubjectId(subject_id))
                    await store.add_if_new(tx, key, key_hash=secret_hash(secret))

    async def issue(
        self, caller: Caller, requested: NewKey, *, idempotency_key: str | None, body: bytes
    ) -> Answer:
        """A new key, with a broker account for a customer; only this answer shows the secrets.

        Raises
        ------
        InvalidInput
            The customer's name is reserved for Skyway's own processes or for drones, or no such
            provider is registered.
        Conflict
            TOO_MANY_KEYS: so many keys of the subject are in use.
        ServiceUnavailable
            The registry could not open the account: repeat the call.
        """
        if requested.role == "customer" and _is_reserved(requested.subject_id):
            detail = f"{requested.subject_id!r} is reserved for Skyway's own processes"
            raise InvalidInput("subject_id", detail)
        await self._must_be_registered(requested, caller)

        async def write(tx: Tx) -> Answer:
            await self._refuse_too_many(tx, requested.role, requested.subject_id)
            issued = await self.add(tx, requested.role, requested.subject_id)
            location = {"Location": f"/v1/keys/{issued.key_id}"}
            return Answer(201, issued.model_dump_json().encode(), location)

        answer = await once(
            self._db,
            caller=str(caller),
            route="POST /v1/keys",
            key=idempotency_key,
            body=body,
            act=write,
            clock=self._clock,
        )
        await self._open_account(IssuedKey.read(answer.body))
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
            used = await store.used(connection, caller.role, SubjectId(caller.subject_id))
        return (UsageQuota(code="TOO_MANY_KEYS", most=self._most_per_subject, used=used),)

    async def _refuse_too_many(self, tx: Tx, role: KeyRole, subject_id: SubjectId) -> None:
        most = self._most_per_subject
        if await store.used(tx.connection, role, subject_id) >= most:
            raise Conflict("TOO_MANY_KEYS", f"{subject_id} has {most} keys: delete one first")

    async def add(self, tx: Tx, role: KeyRole, subject_id: SubjectId) -> IssuedKey:
        """A new key, added in this transaction."""
        key, secret = self._key(role, subject_id), _new_secret()
        await store.add(tx, key, key_hash=secret_hash(secret), is_account_open=role != "customer")
        return IssuedKey(**dict(key), key=secret, mqtt=self._login(role, subject_id))

    async def delete(self, key_id: KeyId) -> None:
        """Delete a key; a customer without keys loses the broker account, too."""
        async with self._db.write() as tx:
            await store.delete(tx, key_id, at=self._clock.wall_now())
            tx.after_commit(self._cached.forget)
        self.wake.set()

    async def close_orphaned_accounts(self) -> bool:
        """One step of the loop: close the broker accounts of customers without a key."""
        async with self._db.read() as connection:
            orphaned = await store.orphaned_accounts(connection)
        for subject_id in orphaned:
            await self._accounts.close_account(subject_id)
            async with self._db.write() as tx:
                await store.account_is_closed(tx, subject_id)
        return False

    async def _open_account(self, issued: IssuedKey) -> None:
        """Have the registry open the account, unless it has this key's password already.

        A repeated answer must not restore a password that a later key has replaced.
        """
        async with self._db.read() as connection:
            is_open = await store.is_account_open(connection, issued.key_id)
        if is_open or issued.mqtt is None:
            return
        await self._accounts.open_account(issued.subject_id, password=issued.mqtt.password)
        async with self._db.write() as tx:
            await store.account_is_open(tx, issued.key_id)

    def _login(self, role: KeyRole, subject_id: SubjectId) -> BrokerLogin | None:
        if role == "operator":
            # All operators read with one account, whose password the deployment made.
            password = read_secret(self._secrets_dir, "mqtt_operator")
            return BrokerLogin(user_name="operator", password=password)
        if role == "customer":
            return BrokerLogin(user_name=subject_id, password=secrets.token_urlsafe(24))
        return None

    def _key(self, role: KeyRole, subject_id: SubjectId) -> ApiKey:
        return ApiKey(
            key_id=KeyId(self._mint("key")),
            role=role,
            subject_id=subject_id,
            created_at=self._clock.wall_now(),
        )


def _is_reserved(name: str) -> bool:
    return name in _RESERVED_NAMES or name.startswith(_DRONE_PREFIX)
