"""Checks the key and the budget of each request, before any of its body is read.

A request with a valid key spends the budget of its tenant: the customer, provider, operator or
drone. Any other request spends the budget of its address. Both pay for the work too. When the
event loop is busy, who asks little goes first. An address that shows wrong keys waits
longer and longer until the next of its keys is looked up. A key in use is looked up even then, and
even if the address has spent its budget. So a caller with wrong keys cannot shut out a customer of
the same address.
"""

import hashlib
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Final, Protocol

from fastapi import Request
from fastapi.security.utils import get_authorization_scheme_param

from skyway.runtime.errors import BudgetSpent, Unauthenticated
from skyway.runtime.http.delays import Brake, WrongKeys
from skyway.runtime.http.identity import Caller, KeyHolder, RefusedKey, ServiceGate
from skyway.runtime.http.loop_time import Account, LoopTurns
from skyway.runtime.http.session_cookie import SESSION_PREFIX, session_in
from skyway.runtime.limits import Meter, Reading, network_of

#: What a request without a key costs its address, and what it costs if it is refused.
KEYLESS_COST: Final = 1.0
REFUSED_COST: Final = 10.0

#: The most valid keys in the cache.
_MOST_RECOGNISED: Final = 20_000

#: Health checks call these paths, so they are never limited.
_NEVER_METERED: Final = frozenset({"/healthz", "/readyz"})
_PUBLIC, _INTERNAL = "/v1/", "/internal/"

#: The budget of an address that has to wait, in problem documents.
_WRONG_KEYS: Final = "WRONG_KEYS"

_NO_KEY: Final = "an API key is needed: Authorization: Bearer sk_..."
_UNKNOWN_KEY: Final = "this API key is not known, has expired, or was withdrawn"


class KeysInUse(Protocol):
    """Looks up the keys that are in use."""

    async def recognise(self, secret: str) -> KeyHolder | RefusedKey:
        """The holder of this key, or why it is refused."""
        ...

    async def may_be_in_use(self, secret: str) -> bool | None:
        """False if the key is not in use; None if only a full look-up can decide."""
        ...


class Refusals(Protocol):
    """Takes note of refused keys."""

    def note(self, refused: RefusedKey, *, method: str, path: str, address: str) -> None:
        """Note a call with a key that was refused, and the address from which it came."""
        ...


@dataclass(frozen=True, slots=True)
class Meters:
    """The budgets of tenants, and of addresses that show no valid key.

    `tenants` counts the requests of each tenant, `refusals` counts refused requests. The refusals
    of operators are not counted, because operators repair the system.
    """

    tenants: Meter
    refusals: Meter
    addresses: Meter

    def spent(self, who: str) -> float:
        """What the tenant or address has spent and not got back yet."""
        return self.tenants.spent(who) + self.addresses.spent(who)

    def charge_refused(self, request: Request) -> None:
        """Charge the address for a request without a key that a route refused."""
        self.addresses.charge(address_of(request), REFUSED_COST)

    def of(self, caller: Caller) -> tuple[Meter, ...]:
        """The meters of this caller."""
        return (self.tenants,) if caller.role == "operator" else (self.tenants, self.refusals)

    def spend_request(self, caller: Caller) -> Reading:
        """Spend one request of the caller's budget.

        Raises
        ------
        BudgetSpent
            The caller has sent too many requests, or too many that were refused.
        """
        if self.refusals in self.of(caller):
            self.refusals.require(str(caller))
        return self.tenants.spend(str(caller))

    def note_refusal(self, caller: Caller) -> None:
        """Count a request of the caller that was wrong or forbidden."""
        if self.refusals in self.of(caller):
            self.refusals.charge(str(caller), 1.0)


@dataclass(frozen=True, slots=True)
class KeyEntrance:
    """Recognises the caller of each request, and charges the right budget.

    `open_calls` need no key, like ``POST /v1/enrolments``. Paths that begin with one of
    `open_paths` need no key either. `code_calls` need no key if their body holds a code: their
    route calls `request.state.recognise_code` with it. If a budget is spent, the refusal is
    delayed.
    """

    keys: KeysInUse
    services: ServiceGate
    meters: Meters
    open_calls: Collection[str]
    refusals: Refusals
    wrong_keys: WrongKeys = field(default_factory=WrongKeys)
    brake: Brake = field(default_factory=Brake)
    open_paths: tuple[str, ...] = ()
    code_calls: Collection[str] = ()
    #: The clock by which the work of a request is measured, seconds.
    now: Callable[[], float] = time.perf_counter
    _turns: LoopTurns = field(init=False)
    #: Hashes of keys that were valid when they were last shown; the latest is last.
    _recognised: dict[bytes, None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_turns", LoopTurns(self.meters.spent))

    async def __call__(self, request: Request) -> Mapping[str, str]:
        """The headers that say what is left of the budget.

        It sets `request.state.caller` and `request.state.holder`, and `request.state.account`,
        which is charged for the work. Long answers ask
        `request.state.is_still_known` whether the key is still in use. The boundary calls
        `request.state.note_refusal` if the request was refused.

        Raises
        ------
        BudgetSpent
            The tenant or the address has spent its budget.
        Unauthenticated
            A key is needed and none is shown, or the key is unknown.
        AccessDenied
            A page of another site uses a browser's session.
        """
        try:
            return await self._admit(request)
        except BudgetSpent:
            await self.brake.hold()
            raise

    async def _admit(self, request: Request) -> Mapping[str, str]:
        path: str = request.scope["path"]
        addresses = self.meters.addresses
        if path in _NEVER_METERED:
            return {}
        if path.startswith(_INTERNAL):
            await self._admit_service(request)
            return {}
        call = f"{request.method} {path}"
        has_code = call in self.code_calls and "Authorization" not in request.headers
        if has_code:
            request.state.recognise_code = partial(self._recognise_code, request)
        is_open = has_code or call in self.open_calls
        is_other = not path.startswith((_PUBLIC, *self.open_paths))
        if is_other or is_open or path.startswith(self.open_paths):
            await self._wait_for_turn(request, address_of(request), addresses)
            cost = REFUSED_COST if is_other else KEYLESS_COST
            return addresses.spend(address_of(request), cost).headers
        if (key := _shown_by(request)) is None:
            await self._wait_for_turn(request, address_of(request), addresses)
            addresses.spend(address_of(request), REFUSED_COST)
            raise Unauthenticated(_NO_KEY)
        holder = await self._recognise(request, key, self.keys)
        request.state.is_still_known = partial(self._is_still_known, key)
        reading = self.meters.spend_request(holder.caller)
        request.state.note_refusal = partial(self.meters.note_refusal, holder.caller)
        await self._wait_for_turn(request, str(holder.caller), self.meters.tenants)
        return reading.headers

    async def _wait_for_turn(self, request: Request, who: str, meter: Meter) -> None:
        """Wait until the request may begin."""
        request.state.account = Account(meter, who, self.now, self._turns.note)
        await self._turns.turn(who)

    async def _admit_service(self, request: Request) -> None:
        try:
            await self.services(request=request)
        except Unauthenticated:
            self.meters.addresses.spend(address_of(request), REFUSED_COST)
            raise

    async def _recognise(self, request: Request, key: str, known: KeysInUse) -> KeyHolder:
        address = address_of(request)
        key_hash = hashlib.sha256(key.encode()).digest()
        if key_hash not in self._recognised:
            await self._wait_for_turn(request, address, self.meters.addresses)
        is_charged = key_hash not in self._recognised and await self._charge(
            request, key, known, address
        )
        shown = await known.recognise(key)
        if isinstance(shown, RefusedKey):
            self._recognised.pop(key_hash, None)
            self.wrong_keys.note(address)
            self._note(shown, request, address)
            raise Unauthenticated(_UNKNOWN_KEY)
        if is_charged:
            self.meters.addresses.charge(address, KEYLESS_COST - REFUSED_COST)
        self._remember(key_hash)
        request.state.holder, request.state.caller = shown, shown.caller
        return shown

    async def _recognise_code(self, request: Request, code: str, codes: KeysInUse) -> KeyHolder:
        """The holder of the key behind a code. A wrong code counts as a wrong key."""
        try:
            return await self._recognise(request, code, codes)
        except BudgetSpent:
            await self.brake.hold()
            raise

    async def _charge(self, request: Request, key: str, known: KeysInUse, address: str) -> bool:
        """Charge the address for a new key; False if it cannot pay, but the key is in use.

        Raises
        ------
        BudgetSpent
            The address has to wait, or has spent its budget, and the key is not in use.
        """
        wait_s = self.wrong_keys.wait_s(address)
        if wait_s > 0 and (is_in_use := await known.may_be_in_use(key)) is not None:
            if is_in_use:
                return False
            self._note(RefusedKey("slowed"), request, address)
            raise BudgetSpent(_WRONG_KEYS, wait_s)
        try:
            self.meters.addresses.spend(address, REFUSED_COST)
        except BudgetSpent:
            if await known.may_be_in_use(key):
                return False
            raise
        return True

    def _note(self, refused: RefusedKey, request: Request, address: str) -> None:
        path: str = request.scope["path"]
        self.refusals.note(refused, method=request.method, path=path, address=address)

    async def _is_still_known(self, key: str) -> bool:
        return isinstance(await self.keys.recognise(key), KeyHolder)

    def _remember(self, key_hash: bytes) -> None:
        self._recognised.pop(key_hash, None)
        self._recognised[key_hash] = None
        if len(self._recognised) > _MOST_RECOGNISED:
            del self._recognised[next(iter(self._recognised))]


@dataclass(frozen=True, slots=True)
class ServiceEntrance:
    """Lets only other services in. Health and metrics are open."""

    gate: ServiceGate

    async def __call__(self, request: Request) -> Mapping[str, str]:
        """Check the service's secret where one is needed; no headers are added.

        Raises
        ------
        Unauthenticated
            The secret of a service is not shown.
        """
        path: str = request.scope["path"]
        if path.startswith((_PUBLIC, _INTERNAL)):
            await self.gate(request=request)
        return {}


def _shown_by(request: Request) -> str | None:
    """The key in the header, or the session in a browser's cookie."""
    if (header := request.headers.get("Authorization")) is None:
        return session_in(request)
    scheme, key = get_authorization_scheme_param(header)
    # The secret of a session is not a key: a stolen cookie must not begin another session.
    if scheme.lower() != "bearer" or key.startswith(SESSION_PREFIX):
        return None
    return key or None


def address_of(request: Request) -> str:
    """The address that is charged for a request without a key: IPv4, or the /64 of IPv6."""
    return "" if request.client is None else network_of(request.client.host)
