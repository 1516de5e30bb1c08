"""Exchanges an enrolment token, and rotates credentials; after a crash the same call continues.

At every moment some of the kept credentials work. The following credentials are kept on disk before
their key is first shown. Showing the key brings them into force. After a crash the key is shown
again: either it is in force already, or it comes into force now, or the cloud does not know it and
the current credentials still work.

A `Crew` is the drones that one agent process serves, with their current credentials.
"""

import asyncio
import hashlib
import logging
import secrets
from collections.abc import Callable, Iterable
from http import HTTPStatus
from typing import Final, Protocol

from skyway.ids import DroneId
from skyway.runtime.errors import InvalidSettings
from skyway.runtime.signing.key_pair import PrivateKey
from skyway_drone_agent.enrolment.cloud import Cloud, CloudAccess, CloudRefused, CloudUnreachable
from skyway_drone_agent.enrolment.enrolled_drone import (
    Attempt,
    Credentials,
    CredentialsFolder,
    EnrolledDrone,
    Enrolment,
    KeptCredentials,
)

log = logging.getLogger(__name__)

#: Wall seconds between two attempts to finish a rotation.
_AGAIN_AFTER_S: Final = 10.0


class NotEnrolled(InvalidSettings):
    """No drone has enrolled here, and there is no token to enrol one."""

    def __init__(self) -> None:
        super().__init__(
            "no such drone has enrolled here: give --fleet FILE, or --enrol TOKEN --api URL"
        )


def enrol(token: str, *, api_url: str, folder: CredentialsFolder) -> KeptCredentials:
    """The credentials for this token, exchanged now or earlier.

    Raises
    ------
    CloudRefused
        The token is unknown, used up or too old.
    CloudUnreachable
        The same call later continues where this one stopped.
    """
    token_sha256 = hashlib.sha256(token.encode()).hexdigest()
    for kept in folder.every():
        if kept.token_sha256 == token_sha256:
            folder.forget_attempt(token_sha256)
            return kept
    # It is on disk before the call, so that a repeated call gets the same answer.
    attempt = folder.attempt(token_sha256, new=_new_attempt())
    public_key = PrivateKey.read(attempt.signing_key).public_key
    answer = Cloud(api_url).post(
        "/v1/enrolments",
        {"enrolment_token": token, "public_key": public_key},
        idempotency_key=attempt.idempotency_key,
    )
    drone = Enrolment.model_validate({**answer, "signing_key": attempt.signing_key})
    kept = KeptCredentials(api_url=api_url, token_sha256=token_sha256, drone=drone)
    folder.keep(kept)
    folder.forget_attempt(token_sha256)
    return kept


def _new_attempt() -> Attempt:
    return Attempt(idempotency_key=secrets.token_urlsafe(32), signing_key=PrivateKey.new().text)


def enrolled(folder: CredentialsFolder, *, drone_id: DroneId | None) -> tuple[KeptCredentials, ...]:
    """The credentials of all drones that enrolled here, or of one drone.

    Raises
    ------
    NotEnrolled
        There are none.
    """
    found = tuple(kept for kept in folder.every() if drone_id in (None, kept.drone.drone_id))
    if not found:
        raise NotEnrolled
    return found


def begin_rotation(kept: KeptCredentials, folder: CredentialsFolder) -> KeptCredentials:
    """The credentials with following ones, which are kept and not in force yet.

    Raises
    ------
    CloudRefused
        The drone was revoked.
    CloudUnreachable
        Nothing has changed.
    """
    if kept.following is not None:
        return kept
    own = PrivateKey.new()
    answer = Cloud(kept.api_url).post(
        "/v1/enrolments/rotations", {"public_key": own.public_key}, key=kept.drone.key
    )
    following = Credentials.model_validate({**answer, "signing_key": own.text})
    begun = kept.model_copy(update={"following": following})
    folder.keep(begun)
    return begun


def settle_rotation(kept: KeptCredentials, folder: CredentialsFolder) -> KeptCredentials:
    """The credentials in force from now on; following ones are brought into force.

    Raises
    ------
    CloudRefused
        The cloud does not accept the drone.
    CloudUnreachable
        It stays unknown which credentials are in force.
    """
    if kept.following is None:
        return kept
    drone = kept.drone
    path = f"/v1/providers/{drone.provider_id}/drones/{drone.drone_id}"
    try:
        Cloud(kept.api_url).get(path, key=kept.following.key)
    except CloudRefused as error:
        if error.status != HTTPStatus.UNAUTHORIZED:
            raise
        settled = kept.model_copy(update={"following": None})
    else:
        settled = kept.followed()
    folder.keep(settled)
    return settled


class Crew(Protocol):
    """Drones to serve."""

    @property
    def drones(self) -> tuple[EnrolledDrone, ...]:
        """The drones, each with its login."""
        ...

    @property
    def accesses(self) -> tuple[CloudAccess, ...]:
        """The drones' access to the cloud; empty without an enrolment."""
        ...

    def settle(self) -> None:
        """Finish the rotations that a crash interrupted."""
        ...

    def rotate(self) -> None:
        """Change the credentials of every drone."""
        ...

    async def changed(self) -> None:
        """Return once the credentials of drones have changed; this may never happen."""
        ...


class RegisteredCrew:
    """Drones of a fleet file, which keep the passwords of their registration."""

    def __init__(self, drones: tuple[EnrolledDrone, ...]) -> None:
        self._drones = drones

    @property
    def drones(self) -> tuple[EnrolledDrone, ...]:
        """The drones of the file."""
        return self._drones

    @property
    def accesses(self) -> tuple[CloudAccess, ...]:
        """None: a registration gives no key."""
        return ()

    def settle(self) -> None:
        """Do nothing: there are no rotations."""

    def rotate(self) -> None:
        """Do nothing: `read_settings` refuses to rotate these drones."""

    async def changed(self) -> None:
        """Wait for ever."""
        await asyncio.Event().wait()


class EnrolledCrew:
    """Drones that enrolled. No other process may serve them during a rotation."""

    def __init__(
        self,
        kept: Iterable[KeptCredentials],
        folder: CredentialsFolder,
        *,
        again_after_s: float = _AGAIN_AFTER_S,
    ) -> None:
        self._kept = {each.drone.drone_id: each for each in kept}
        self._folder = folder
        self._again_after_s = again_after_s

    @property
    def drones(self) -> tuple[EnrolledDrone, ...]:
        """The drones, each with the credentials that were last in force."""
        return tuple(each.drone for each in self._kept.values())

    @property
    def accesses(self) -> tuple[CloudAccess, ...]:
        """The drones' own keys."""
        return tuple(CloudAccess(each.api_url, each.drone.key) for each in self._kept.values())

    async def changed(self) -> None:
        """Return once an interrupted rotation has finished; without one never."""
        before = self.drones
        while any(each.following for each in self._kept.values()):
            await asyncio.sleep(self._again_after_s)
            await asyncio.to_thread(self.settle)
            if self.drones != before:
                return
        await asyncio.Event().wait()

    def rotate(self) -> None:
        """Change the credentials of every drone; after a failure a drone keeps its credentials."""
        self._each(begin_rotation)
        self.settle()

    def settle(self) -> None:
        """Finish the rotations that have begun; without the cloud the old credentials stay."""
        self._each(settle_rotation)

    def _each(self, do: Callable[[KeptCredentials, CredentialsFolder], KeptCredentials]) -> None:
        for drone_id, kept in self._kept.items():
            try:
                self._kept[drone_id] = do(kept, self._folder)
            except (CloudUnreachable, CloudRefused) as error:
                log.warning(
                    "credentials not rotated", extra={"drone_id": drone_id, "reason": str(error)}
                )
