"""Exchanges an enrolment token, and rotates credentials; after a crash the same call continues.

At every moment some of the kept credentials work. The following credentials are kept on disk before
their key is first shown. Showing the key brings them into force. After a crash the key is shown
again: either it is in force already, or it comes into force now, or the cloud does not know it and
the current credentials still work.
"""

import hashlib
import secrets
from http import HTTPStatus

from skyway.errors import SkywayError
from skyway.ids import DroneId
from skyway_drone_agent.enrolment.cloud import Cloud, CloudRefused
from skyway_drone_agent.enrolment.credentials import (
    Credentials,
    CredentialsFolder,
    Enrolment,
    KeptCredentials,
)


class NotEnrolled(SkywayError):
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
    # The key is on disk before the call, so that a repeated call gets the same answer.
    attempt = folder.attempt(token_sha256, new_key=secrets.token_urlsafe(32))
    answer = Cloud(api_url).post(
        "/v1/enrolments", {"enrolment_token": token}, idempotency_key=attempt
    )
    drone = Enrolment.model_validate(answer)
    kept = KeptCredentials(api_url=api_url, token_sha256=token_sha256, drone=drone)
    folder.keep(kept)
    folder.forget_attempt(token_sha256)
    return kept


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
    """The same with following credentials, which are kept and not in force yet.

    Raises
    ------
    CloudRefused
        The drone was revoked.
    CloudUnreachable
        Nothing has changed.
    """
    if kept.following is not None:
        return kept
    answer = Cloud(kept.api_url).post("/v1/enrolments/rotations", {}, key=kept.drone.key)
    begun = kept.model_copy(update={"following": Credentials.model_validate(answer)})
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
