"""Rotation: after a crash at any moment, kept credentials work once the rotation is finished."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.enrolment.cloud import CloudRefused, CloudUnreachable
from skyway_drone_agent.enrolment.enrol import EnrolledCrew, begin_rotation, enrol, settle_rotation
from skyway_drone_agent.enrolment.enrolled_drone import CredentialsFolder, KeptCredentials

from skyway.runtime.signing.key_pair import PrivateKey


@pytest.fixture
def folder(tmp_path: Path) -> CredentialsFolder:
    return CredentialsFolder(tmp_path)


@pytest.fixture
def kept(cloud: Any, folder: CredentialsFolder) -> KeptCredentials:
    return enrol("enr_good", api_url=cloud.url, folder=folder)


def restarted(folder: CredentialsFolder) -> EnrolledCrew:
    """What the next process starts with."""
    return EnrolledCrew(folder.every(), folder)


def password(crew: EnrolledCrew) -> str:
    [drone] = crew.drones
    return drone.mqtt.password


def test_a_rotation_ends_with_credentials_that_the_broker_accepts(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    crew = EnrolledCrew([kept], folder)

    crew.rotate()

    assert password(crew) == cloud.password != kept.drone.mqtt.password
    assert password(restarted(folder)) == cloud.password
    assert crew.drones[0].mqtt_urls == ("mqtt://node-2:1883",), "as the cloud names them now"


def test_a_rotation_brings_another_signing_key_that_never_leaves_the_drone(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    crew = EnrolledCrew([kept], folder)
    [before] = crew.drones

    crew.rotate()

    [after] = crew.drones
    keys = [PrivateKey.read(each.signing_key or "").public_key for each in (before, after)]
    assert cloud.public_keys == keys
    assert len({*keys}) == 2
    assert restarted(folder).drones == crew.drones


def test_a_lost_rotation_leaves_the_old_credentials(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    cloud.loses = 1
    with pytest.raises(CloudUnreachable):
        begin_rotation(kept, folder)

    crew = restarted(folder)
    crew.settle()

    assert password(crew) == cloud.password == kept.drone.mqtt.password


def test_a_rotation_completes_after_a_crash_before_the_first_use(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    begin_rotation(kept, folder)

    crew = restarted(folder)
    before = cloud.password
    crew.settle()

    assert before == kept.drone.mqtt.password
    assert password(crew) == cloud.password != before


def test_a_rotation_completes_after_a_crash_behind_the_first_use(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    begun = begin_rotation(kept, folder)
    cloud.loses = 1
    with pytest.raises(CloudUnreachable):
        settle_rotation(begun, folder)

    crew = restarted(folder)
    crew.settle()

    assert cloud.password != kept.drone.mqtt.password
    assert password(crew) == cloud.password


def test_credentials_that_were_never_in_force_are_dropped(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    begin_rotation(kept, folder)
    del cloud.keys["next"]

    crew = restarted(folder)
    crew.settle()

    assert password(crew) == cloud.password
    assert folder.every() == (kept,)


def test_a_drone_starts_without_the_cloud(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    begin_rotation(kept, folder)
    cloud.is_down = True

    crew = restarted(folder)
    crew.settle()

    assert password(crew) == kept.drone.mqtt.password


async def test_an_interrupted_rotation_is_finished_when_the_cloud_is_back(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    begun = begin_rotation(kept, folder)
    cloud.loses = 1
    with pytest.raises(CloudUnreachable):
        settle_rotation(begun, folder)
    crew = EnrolledCrew(folder.every(), folder, again_after_s=0.01)

    async with asyncio.timeout(60):
        await crew.changed()

    assert password(crew) == cloud.password


def test_a_revoked_drone_cannot_rotate_and_keeps_its_credentials(
    cloud: Any, kept: KeptCredentials, folder: CredentialsFolder
) -> None:
    cloud.keys = {}
    with pytest.raises(CloudRefused, match="401"):
        begin_rotation(kept, folder)

    crew = restarted(folder)
    crew.rotate()

    assert password(crew) == kept.drone.mqtt.password
