"""The accounts that may connect, the place of each client, and the delay after wrong passwords."""

import asyncio

import pytest
from skyway_broker.gate import MOST_DELAY_S, Gate, TooManyAttempts, WrongPasswords
from skyway_broker.hardened import place_of

from skyway.broker_setup.passwords import hash_password, write_password_file


def test_an_account_needs_its_own_password(tmp_path):
    write_password_file(tmp_path / "passwords", {"drone-1": hash_password("a")})
    gate = Gate(tmp_path / "passwords")
    gate.refresh()

    assert gate.admits("drone-1", "a")
    assert not gate.admits("drone-1", "b")
    assert not gate.admits("drone-1", None)
    assert not gate.admits("drone-2", "a")
    assert not gate.admits(None, None)


def test_refused_logins_are_counted_in_a_file_beside_the_accounts(tmp_path):
    refused = Gate(tmp_path / "passwords").refused
    refused.write()
    before = (tmp_path / "refused_logins").read_text()

    for _ in range(3):
        refused.note()
    refused.write()

    assert (before, (tmp_path / "refused_logins").read_text()) == ("0\n", "3\n")


def test_a_folder_that_cannot_be_written_does_not_end_the_broker(tmp_path):
    Gate(tmp_path / "nowhere" / "passwords").refused.write()


def test_a_replaced_file_is_read_and_an_unchanged_file_is_not_read_again(tmp_path):
    write_password_file(tmp_path / "passwords", {"drone-1": hash_password("a")})
    gate = Gate(tmp_path / "passwords")

    assert gate.refresh()
    assert not gate.refresh()

    write_password_file(tmp_path / "passwords", {"drone-2": hash_password("a")})

    assert gate.refresh()
    assert not gate.admits("drone-1", "a")
    assert gate.admits("drone-2", "a")


def test_without_a_file_no_account_exists_and_a_deleted_file_changes_nothing(tmp_path):
    gate = Gate(tmp_path / "passwords")
    assert not gate.refresh()
    assert not gate.admits("drone-1", "a")
    write_password_file(tmp_path / "passwords", {"drone-1": hash_password("a")})
    gate.refresh()

    (tmp_path / "passwords").unlink()

    assert not gate.refresh()
    assert gate.admits("drone-1", "a")


def test_a_drone_has_one_place_for_all_client_ids():
    assert place_of("drone-1", "drone-2") == place_of("drone-1", "drone-1")
    assert place_of("drone-1", "x") != place_of("drone-2", "x")


def test_replicas_of_a_service_have_places_that_no_drone_can_use():
    assert place_of("composition", "a") != place_of("composition", "b")
    assert place_of("composition", "drone-1") != place_of("drone-1", "drone-1")


def test_an_unknown_account_takes_as_many_rounds_as_a_wrong_password(tmp_path, monkeypatch):
    compared: list[str] = []

    def compare(_: str, hashed: str) -> bool:
        compared.append(hashed)
        return False

    monkeypatch.setattr("skyway_broker.gate.matches", compare)
    write_password_file(tmp_path / "passwords", {"drone-1": hash_password("a")})
    gate = Gate(tmp_path / "passwords")
    gate.refresh()

    assert not gate.admits("drone-1", "wrong")
    assert not gate.admits("drone-2", "wrong")

    assert [hashed.split("$")[1:3] for hashed in compared] == [["7", "1"]] * 2


def test_an_empty_password_opens_no_unknown_account(tmp_path):
    gate = Gate(tmp_path / "passwords")

    assert not gate.admits("drone-1", "")
    assert not gate.admits("", "")


def mistaken(*, times: int) -> WrongPasswords:
    wrong_passwords = WrongPasswords(now=lambda: 1_000.0)
    for _ in range(times):
        wrong_passwords.note("attacker", "drone-1", was_right=False)
    return wrong_passwords


def test_the_delay_grows_with_each_wrong_password_up_to_a_limit():
    delays = [mistaken(times=times).delay_s("attacker", "drone-1") for times in range(10)]

    assert delays == [0, 0, 0, 0.25, 0.5, 1.0, 2.0, 4.0, MOST_DELAY_S, MOST_DELAY_S]
    assert mistaken(times=5_000).delay_s("attacker", "drone-1") == MOST_DELAY_S


def test_wrong_passwords_delay_no_other_address_and_no_other_account():
    wrong_passwords = mistaken(times=9)

    assert wrong_passwords.delay_s("home of the drone", "drone-1") == 0
    assert wrong_passwords.delay_s("attacker", "drone-2") == 0


def test_the_right_password_and_a_long_pause_end_the_delay():
    now_s = 0.0
    wrong_passwords = WrongPasswords(now=lambda: now_s)
    for account in ("drone-1", "drone-2"):
        for _ in range(9):
            wrong_passwords.note("here", account, was_right=False)

    wrong_passwords.note("here", "drone-1", was_right=True)

    assert wrong_passwords.delay_s("here", "drone-1") == 0
    assert wrong_passwords.delay_s("here", "drone-2") == MOST_DELAY_S
    now_s = 601.0
    assert wrong_passwords.delay_s("here", "drone-2") == 0


async def test_few_attempts_wait_and_the_others_are_not_compared():
    wrong_passwords = mistaken(times=9)
    waiting = [asyncio.create_task(wrong_passwords.wait("attacker", "drone-1")) for _ in range(4)]
    await asyncio.sleep(0)

    with pytest.raises(TooManyAttempts):
        await wrong_passwords.wait("attacker", "drone-1")
    await wrong_passwords.wait("home of the drone", "drone-1")

    for task in waiting:
        task.cancel()
    await asyncio.gather(*waiting, return_exceptions=True)
    last = asyncio.create_task(wrong_passwords.wait("attacker", "drone-1"))
    await asyncio.sleep(0)
    assert not last.done()
    last.cancel()
