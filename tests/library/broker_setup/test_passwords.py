"""The password file that both brokers read."""

import shutil
import stat
import subprocess

import pytest

from skyway.broker_setup.passwords import (
    hash_password,
    matches,
    read_password_file,
    write_password_file,
)
from skyway.errors import InvalidInput


def test_a_password_matches_only_its_own_hash():
    hashed = hash_password("secret")

    assert matches("secret", hashed)
    assert not matches("Secret", hashed)
    assert not matches("", hashed)


def test_the_same_password_has_another_hash_each_time():
    assert hash_password("secret") != hash_password("secret")


@pytest.mark.parametrize(
    "hashed", ["", "secret", "$7$101$salt", "$6$101$c2FsdA==$a2V5", "$7$x$c2FsdA==$a2V5", "$7$0$$"]
)
def test_a_hash_of_another_kind_matches_nothing(hashed):
    assert not matches("secret", hashed)


def test_written_accounts_can_be_read(tmp_path):
    accounts = {"drone-1": hash_password("a"), "drone-2": hash_password("b")}

    write_password_file(tmp_path / "passwords", accounts)

    assert read_password_file(tmp_path / "passwords") == accounts


def test_only_the_owner_can_read_the_file_and_no_draft_is_left(tmp_path):
    write_password_file(tmp_path / "passwords", {"drone-1": hash_password("a")})
    write_password_file(tmp_path / "passwords", {})

    assert [path.name for path in tmp_path.iterdir()] == ["passwords"]
    assert stat.S_IMODE((tmp_path / "passwords").stat().st_mode) == 0o600


@pytest.mark.parametrize("name", ["a:b", "a\nb", "+", "", "x" * 65, "a/", "/a", "a/b/c"])
def test_a_user_name_that_is_no_identifier_is_refused(tmp_path, name):
    with pytest.raises(InvalidInput):
        write_password_file(tmp_path / "passwords", {name: hash_password("a")})


@pytest.mark.integration
@pytest.mark.skipif(shutil.which("mosquitto_passwd") is None, reason="no mosquitto_passwd here")
def test_a_hash_by_mosquitto_matches_too(tmp_path):
    path = tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-c", "-b", path, "drone-1", "secret"], check=True)

    assert matches("secret", read_password_file(path)["drone-1"])
