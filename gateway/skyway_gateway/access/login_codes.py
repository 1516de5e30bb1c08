"""The codes of links that log a browser in: each stands for a key once, for ten minutes."""

import secrets
from datetime import datetime, timedelta
from typing import Final

from skyway.ids import KeyId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.identity import KeyHolder, RefusedKey
from skyway.runtime.peer_secrets import secret_hash
from skyway.runtime.sql.database import Database, Tx
from skyway_gateway.access import session_store
from skyway_gateway.access.recognise import CachedKeys, KeysInUse

#: Where the console reads the code; browsers do not send what follows `#`.
_LOGIN_PATH: Final = "/console#login="

#: How long a code can be used, wall time.
CODE_LASTS: Final = timedelta(minutes=10)

_SECRET_BYTES: Final = 32


class LoginCodes:
    """Makes, recognises and uses codes; only hashes are stored. Links begin as `public_url`."""

    def __init__(self, db: Database, clock: FleetClock, public_url: str) -> None:
        self._clock = clock
        self._public_url = public_url.rstrip("/")
        self._codes = CachedKeys(db, clock, session_store.shown_by_link)
        self._in_use = KeysInUse(db, clock, session_store.links_in_use)

    async def make(self, tx: Tx, key_id: KeyId) -> tuple[str, datetime]:
        """A new code for this key, and when it expires."""
        code = secrets.token_urlsafe(_SECRET_BYTES)
        expires_wall_at = self._clock.wall_now() + CODE_LASTS
        await session_store.add_link(tx, secret_hash(code), key_id, expires_at=expires_wall_at)
        return code, expires_wall_at

    def url_of(self, code: str) -> str:
        """The link with this code."""
        return f"{self._public_url}{_LOGIN_PATH}{code}"

    async def use(self, tx: Tx, code: str) -> bool:
        """Use a code; False if it was used before or has expired."""
        tx.after_commit(self._codes.forget)
        return await session_store.use_link(tx, secret_hash(code), at=self._clock.wall_now())

    async def recognise(self, secret: str) -> KeyHolder | RefusedKey:
        """The holder of the key of this code, or why the code is refused."""
        shown = await self._codes.recognise(secret)
        if isinstance(shown, RefusedKey):
            self._in_use.forget(secret_hash(secret))
        return shown

    async def may_be_in_use(self, secret: str) -> bool:
        """False for a code that cannot be used."""
        return await self._in_use.may_hold(secret_hash(secret))
