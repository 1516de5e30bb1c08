"""Exchanges an enrolment token; after a crash at any moment the same call continues."""

import hashlib
import secrets

from skyway.errors import SkywayError
from skyway.ids import DroneId
from skyway_drone_agent.enrolment.cloud import Cloud
from skyway_drone_agent.enrolment.credentials import CredentialsFolder, Enrolment, KeptCredentials


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
