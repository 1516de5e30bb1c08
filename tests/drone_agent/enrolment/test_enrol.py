"""A token is exchanged once, also after a lost message or a crash."""

import hashlib
import logging
import stat
from pathlib import Path
from typing import Any

import pytest
from skyway_drone_agent.enrolment.cloud import Cloud, CloudRefused, CloudUnreachable
from skyway_drone_agent.enrolment.enrol import NotEnrolled, enrol, enrolled
from skyway_drone_agent.enrolment.enrolled_drone import (
    Attempt,
    CredentialsFolder,
    DamagedCredentials,
    Enrolment,
)

from skyway.errors import InvalidInput
from skyway.ids import DroneId
from skyway.runtime.signing.key_pair import PrivateKey


def test_the_credentials_for_a_token_are_readable_only_by_this_user(
    tmp_path: Path, cloud: Any
) -> None:
    folder = CredentialsFolder(tmp_path / "journal")

    given = enrol("enr_good", api_url=cloud.url, folder=folder)

    assert (given.drone.drone_id, given.drone.mqtt.password) == ("drn_1", cloud.password)
    assert given.drone.mqtt_urls == ("mqtt://node-1:1883",)
    assert enrolled(folder, drone_id=None) == (given,)
    [kept] = (tmp_path / "journal").iterdir()
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600


def public_key_of(drone: Enrolment) -> str:
    assert drone.signing_key is not None
    return PrivateKey.read(drone.signing_key).public_key


def test_the_same_command_line_asks_once(tmp_path: Path, cloud: Any) -> None:
    folder = CredentialsFolder(tmp_path)
    first = enrol("enr_good", api_url=cloud.url, folder=folder)
    cloud.is_down = True

    again = enrol("enr_good", api_url=cloud.url, folder=folder)

    assert again == first
    assert cloud.asked == ["POST /v1/enrolments"]


def test_a_lost_answer_is_asked_for_again(tmp_path: Path, cloud: Any) -> None:
    folder = CredentialsFolder(tmp_path)
    cloud.loses = 1
    with pytest.raises(CloudUnreachable):
        enrol("enr_good", api_url=cloud.url, folder=folder)

    # As after a crash: nothing but the folder is left.
    given = enrol("enr_good", api_url=cloud.url, folder=CredentialsFolder(tmp_path))

    assert given.drone.mqtt.password == cloud.password
    assert cloud.made == 1
    # The repeated call registers the same key, and the drone has it.
    assert cloud.public_keys == [public_key_of(given.drone)] * 2


def test_a_cloud_that_has_no_budget_left_for_the_address_is_asked_again_later(
    tmp_path: Path, cloud: Any
) -> None:
    folder = CredentialsFolder(tmp_path)
    cloud.is_busy = True
    with pytest.raises(CloudUnreachable, match="spent"):
        enrol("enr_good", api_url=cloud.url, folder=folder)
    cloud.is_busy = False

    assert enrol("enr_good", api_url=cloud.url, folder=folder).drone.mqtt.password == cloud.password


def test_a_used_token_is_worthless_to_a_thief(tmp_path: Path, cloud: Any) -> None:
    enrol("enr_good", api_url=cloud.url, folder=CredentialsFolder(tmp_path / "ours"))

    with pytest.raises(CloudRefused, match="TOKEN_USED"):
        enrol("enr_good", api_url=cloud.url, folder=CredentialsFolder(tmp_path / "theirs"))


def test_no_secret_is_shown(tmp_path: Path, cloud: Any, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    folder = CredentialsFolder(tmp_path)
    given = enrol("enr_good", api_url=cloud.url, folder=folder)
    with pytest.raises(CloudRefused) as refused:
        enrol("enr_bad", api_url=cloud.url, folder=folder)

    shown = f"{caplog.text} {given!r} {refused.value}"
    signing_key = given.drone.signing_key or ""
    for secret in ("enr_good", "enr_bad", cloud.password, given.drone.key, signing_key):
        assert secret not in shown


def test_an_unreachable_cloud_is_named_in_the_error(tmp_path: Path) -> None:
    with pytest.raises(CloudUnreachable, match="does not answer"):
        enrol("enr_good", api_url="http://127.0.0.1:9", folder=CredentialsFolder(tmp_path))


@pytest.mark.parametrize("url", ["", "ftp://host", "file:///etc/passwd", "host:80"])
def test_an_invalid_address_is_refused(url: str) -> None:
    with pytest.raises(InvalidInput, match="api"):
        Cloud(url)


def test_without_an_enrolled_drone_the_agent_stops(tmp_path: Path, cloud: Any) -> None:
    folder = CredentialsFolder(tmp_path)
    with pytest.raises(NotEnrolled):
        enrolled(folder, drone_id=None)

    given = enrol("enr_good", api_url=cloud.url, folder=folder)

    assert enrolled(folder, drone_id=given.drone.drone_id) == (given,)
    with pytest.raises(NotEnrolled):
        enrolled(folder, drone_id=DroneId("drn_2"))


def test_an_error_about_damaged_credentials_shows_no_secret(tmp_path: Path, cloud: Any) -> None:
    folder = CredentialsFolder(tmp_path)
    enrol("enr_good", api_url=cloud.url, folder=folder)
    [path] = tmp_path.glob("*.credentials.json")
    path.write_text(path.read_text().replace('"soc"', '"sock"'))

    with pytest.raises(DamagedCredentials) as damaged:
        folder.every()

    assert cloud.password not in str(damaged.value)


def test_an_attempt_keeps_its_first_key(tmp_path: Path) -> None:
    folder = CredentialsFolder(tmp_path)
    token_sha256 = hashlib.sha256(b"enr_good").hexdigest()

    one = Attempt(idempotency_key="one", signing_key="first")
    two = Attempt(idempotency_key="two", signing_key="second")

    assert folder.attempt(token_sha256, new=one) == one
    assert folder.attempt(token_sha256, new=two) == one
