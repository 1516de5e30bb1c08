"""Changing credentials, so that at every moment some that are kept work, or soon will.

The following ones are kept before they are first shown. Showing their key brings them into force;
who crashes before knowing shows it again: it is either in force already, or comes into force now,
or was never given out, and then the present ones have never stopped.
"""

from http import HTTPStatus

from skyway_drone_agent.enrolment.cloud import Cloud, CloudRefused
from skyway_drone_agent.enrolment.credentials import Credentials, CredentialsFolder, KeptCredentials


def begin(kept: KeptCredentials, folder: CredentialsFolder) -> KeptCredentials:
    """The same with credentials that follow, kept and not in force yet.

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


def settle(kept: KeptCredentials, folder: CredentialsFolder) -> KeptCredentials:
    """What works from now on: the following credentials, if any, are brought into force.

    Raises
    ------
    CloudRefused
        The drone is not what its credentials say.
    CloudUnreachable
        It is not known which of them are in force.
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
