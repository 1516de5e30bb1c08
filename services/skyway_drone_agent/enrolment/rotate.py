"""Rotates credentials, so that at every moment some of the kept credentials work.

The following credentials are kept on disk before their key is first shown. Showing the key brings
them into force. After a crash the key is shown again: either it is in force already, or it comes
into force now, or the cloud does not know it and the current credentials still work.
"""

from http import HTTPStatus

from skyway_drone_agent.enrolment.cloud import Cloud, CloudRefused
from skyway_drone_agent.enrolment.credentials import Credentials, CredentialsFolder, KeptCredentials


def begin(kept: KeptCredentials, folder: CredentialsFolder) -> KeptCredentials:
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


def settle(kept: KeptCredentials, folder: CredentialsFolder) -> KeptCredentials:
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
