"""The accounts that may connect, and the place of each client."""

from skyway_broker.hardened import Gate, place_of

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
