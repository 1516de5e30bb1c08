"""A cache of the keys of drones; the registry has the current keys.

A key is looked up when a drone's first message comes, and when a message does not verify, because
the drone may have another key by now. Keys that were replaced or revoked are dropped within
seconds, because `refresh` reads what has changed.
"""

import logging
from collections.abc import Collection, Iterable
from datetime import datetime, timedelta
from typing import Final, Literal, Protocol

from skyway.contracts.drones import MOST_ASKED, DroneSignature
from skyway.errors import InvalidInput
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.signing.key_pair import is_signed_by, public_key_bytes

log = logging.getLogger(__name__)

#: Whether a message is from its drone. UNKNOWN: the drone's key was not looked up.
SignatureResult = Literal["PROVEN", "FORGED", "UNKNOWN"]

#: Wall time for which the registry lists a changed key.
CHANGES_NAMED_FOR: Final = timedelta(minutes=1)
#: Wall time for which a key counts as current after it was looked up.
_CURRENT_FOR: Final = timedelta(seconds=2)
#: The most drones whose keys are kept, about 300 bytes each.
_MOST_KEPT: Final = 50_000


class KeySource(Protocol):
    """The registry's answers."""

    async def of(self, drone_ids: Collection[DroneId]) -> Iterable[DroneSignature]:
        """How each of these drones signs; `ServiceUnavailable` if there is no answer."""
        ...

    async def changed(self) -> Iterable[DroneSignature]:
        """How the drones sign whose credentials changed within `CHANGES_NAMED_FOR`."""
        ...


class KeyBook:
    """Judges messages by cached keys, and looks keys up in its source."""

    def __init__(self, source: KeySource, clock: FleetClock) -> None:
        self._source = source
        self._clock = clock
        #: By drone. None: the drone does not sign. Empty bytes: no message of the drone is valid.
        self._keys: dict[str, bytes | None] = {}
        self._looked_up_at: dict[str, datetime] = {}
        self._refreshed_at = clock.wall_now()

    def judge(self, drone_id: str, topic_name: str, payload: bytes) -> SignatureResult:
        """Whether this payload on this topic is from the drone, by the cached keys."""
        if drone_id not in self._keys:
            return "UNKNOWN"
        key = self._keys[drone_id]
        if key is None or (key and is_signed_by(key, topic_name, payload)):
            return "PROVEN"
        return "FORGED"

    def has_key(self, drone_id: str) -> bool:
        """Whether the drone is known to sign its messages."""
        return self._keys.get(drone_id) is not None

    def is_current(self, drone_id: str) -> bool:
        """Whether the drone's key was looked up just now."""
        looked_up_at = self._looked_up_at.get(drone_id)
        return looked_up_at is not None and self._clock.wall_now() - looked_up_at < _CURRENT_FOR

    async def look_up(self, drone_ids: Collection[DroneId]) -> None:
        """Look up the keys of these drones.

        Raises
        ------
        ServiceUnavailable
            The source is away; the cached keys stay.
        """
        sorted_ids = sorted(drone_ids)
        self._forget_old()
        for first in range(0, len(sorted_ids), MOST_ASKED):
            part = sorted_ids[first : first + MOST_ASKED]
            answer = list(await self._source.of(part))
            now = self._clock.wall_now()
            # A drone that the source leaves out is not registered: no message of it is valid.
            left_out = set(part) - {each.drone_id for each in answer}
            self._keys.update(dict.fromkeys(left_out, b""))
            self._keep(answer)
            self._looked_up_at.update(dict.fromkeys(part, now))

    async def refresh(self) -> bool:
        """Step of a loop: read the changed keys; always False.

        Raises
        ------
        ServiceUnavailable
            The source is away. After a minute without it all keys are looked up anew.
        """
        asked_at = self._clock.wall_now()
        changed = await self._source.changed() if self._keys else ()
        if asked_at - self._refreshed_at > CHANGES_NAMED_FOR / 2:
            self._keys.clear()
        self._refreshed_at = asked_at
        self._keep(each for each in changed if each.drone_id in self._keys)
        return False

    def _forget_old(self) -> None:
        while len(self._keys) > _MOST_KEPT:
            self._keys.pop(next(iter(self._keys)))
        self._looked_up_at = {
            each: at for each, at in self._looked_up_at.items() if self.is_current(each)
        }

    def _keep(self, signatures: Iterable[DroneSignature]) -> None:
        for each in signatures:
            key = _key_of(each)
            # Nothing ends the duty to sign: a source that says so has lost the drone's key.
            has_signed = key is None and bool(self._keys.get(each.drone_id))
            self._keys[each.drone_id] = b"" if has_signed else key


def _key_of(signature: DroneSignature) -> bytes | None:
    if not signature.is_signed:
        return None
    if signature.public_key is None:
        return b""
    try:
        return public_key_bytes(signature.public_key)
    except InvalidInput:
        log.exception("drone has no valid key", extra={"drone_id": signature.drone_id})
        return b""
