"""Who lives in the small world is kept over restarts, and readable by its user only."""

from pathlib import Path

from skyway.cli.data_folder import DataFolder
from skyway.cli.demo.fleets import RegisteredFleet
from skyway.cli.gateway import read_keys
from skyway.cli.small_world.living import Inhabitants
from skyway.cli.system.secrets import keep_provider_key, make_secrets, write_keys_file

ADDRESSES = ("http://127.0.0.1:8000", "mqtt://127.0.0.1:1883")


def test_what_was_kept_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "small-world.json"
    known = Inhabitants.read(file)
    known.fleets["Alamo Air"] = RegisteredFleet("prv_1", "sk_provider", [{"drone_id": "drn_1"}])
    known.customer_keys["river-books"] = "sk_books"

    known.keep()

    assert Inhabitants.read(file) == known
    assert known.drones == [{"drone_id": "drn_1"}]
    assert file.stat().st_mode & 0o777 == 0o600


def test_a_key_of_a_provider_is_in_keys_env_from_now_on(tmp_path: Path) -> None:
    folder = DataFolder(tmp_path)
    make_secrets(folder)
    write_keys_file(folder, *ADDRESSES)
    assert "SKYWAY_PROVIDER_KEY" not in read_keys(folder)

    keep_provider_key(folder, "sk_provider")
    assert read_keys(folder)["SKYWAY_PROVIDER_KEY"] == "sk_provider"

    write_keys_file(folder, *ADDRESSES)
    assert read_keys(folder)["SKYWAY_PROVIDER_KEY"] == "sk_provider"
    assert read_keys(folder)["SKYWAY_GATEWAY_URL"] == ADDRESSES[0]
