"""`skyway fleet --drones` checks everything before it registers anything."""

from pathlib import Path
from typing import Any, get_args

import pytest
from typer.testing import CliRunner

from skyway.cli.drones import fleet
from skyway.cli.main import make_app
from skyway.contracts.candidate import Standby
from skyway.runtime.signing.key_pair import PrivateKey
from tests.library.cli.conftest import Gateway

runner = CliRunner()

REGISTER_PROVIDER = ("POST", "/v1/providers")
REGISTER_DRONES = ("POST", "/v1/providers/prv_1/drones")


@pytest.fixture
def gateway(answering_gateway: Gateway) -> Gateway:
    """A gateway with one drone model and one station, where fleets can be registered."""
    answering_gateway.answers |= {
        ("GET", "/v1/drone-models/dji-matrice-300-rtk"): (200, {}),
        ("GET", "/v1/stations/home/pads"): (200, {}),
        REGISTER_PROVIDER: (201, {"provider_id": "prv_1"}),
        REGISTER_DRONES: (201, {"items": [{"drone_id": "drn_1"}]}),
        ("PATCH", "/v1/providers/prv_1"): (200, {}),
    }
    return answering_gateway


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--model", "nope", "--home", "home"], "no route"),
        (["--home", "nowhere"], "no route"),
        (["--home", "home", "--charge-time-factor=-2"], "charge_time_factor: must be"),
        (["--home", "home", "--scenario", "nope"], "scenario: nope is"),
        (["missing-folder/fleet.json", "--home", "home"], "cannot be written"),
    ],
)
def test_a_fleet_that_cannot_fly_registers_no_provider(
    gateway: Gateway, options: list[str], message: str
) -> None:
    result = runner.invoke(make_app(), ["fleet", "--drones", "2", *options])

    assert result.exit_code == 1
    assert message in result.stderr
    assert [call for call in gateway.called if call[0] != "GET"] == []


def test_a_fleet_without_a_network_says_how_to_publish_one(gateway: Gateway) -> None:
    gateway.answers["GET", "/v1/networks"] = (200, {"items": []})

    result = runner.invoke(make_app(), ["fleet", "--drones", "2"])

    assert result.exit_code == 1
    assert "no network is published: skyway network import bundled" in result.stderr
    assert REGISTER_PROVIDER not in gateway.called


def test_the_drones_of_a_fleet_get_the_standby_that_was_asked_for(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet, "fly", lambda *_: None)

    options = ["--drones", "1", "--home", "home", "--standby", "STAY"]
    result = runner.invoke(make_app(), ["fleet", *options])

    assert result.exit_code == 0, result.stderr
    assert [drone["standby"] for drone in gateway.calls[-1][2]] == ["STAY"]
    assert [each.value for each in fleet.StandbyName] == list(get_args(Standby))


def test_an_unknown_standby_is_refused_with_its_choices(gateway: Gateway) -> None:
    result = runner.invoke(make_app(), ["fleet", "--drones", "1", "--standby", "ROAM"])

    assert result.exit_code == 2
    assert all(name in result.stderr for name in ("--standby", "HOME", "STAY", "PARKING"))
    assert gateway.calls == []


def test_a_new_provider_whose_drones_are_refused_is_suspended(gateway: Gateway) -> None:
    gateway.answers[REGISTER_DRONES] = (503, {"detail": "composition is unavailable"})

    result = runner.invoke(make_app(), ["fleet", "--drones", "2", "--home", "home"])

    assert result.exit_code == 1
    assert gateway.calls[-1] == ("PATCH", "/v1/providers/prv_1", {"state": "SUSPENDED"})
    assert "the new provider prv_1 has no drones, and is suspended" in result.stderr
    assert 'PATCH /v1/providers/prv_1 {"state": "ACTIVE"}, and add --provider prv_1' in (
        result.stderr
    )


def test_a_providers_key_registers_the_fleet_with_its_own_provider(
    gateway: Gateway, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet, "fly", lambda *_: None)
    monkeypatch.setenv("SKYWAY_PROVIDER_KEY", "sk_provider")
    own = {"provider_id": "prv_1", "name": "Hill Country Drones"}
    gateway.answers["GET", "/v1/providers"] = (200, {"items": [own], "next_cursor": None})

    result = runner.invoke(make_app(), ["fleet", "--drones", "1", "--home", "home"])

    assert result.exit_code == 0, result.stderr
    assert REGISTER_PROVIDER not in gateway.called
    assert gateway.called[-1] == REGISTER_DRONES
    assert set(gateway.keys) == {"sk_provider"}


def test_a_fleet_that_can_fly_is_registered_and_stored(
    gateway: Gateway, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[Any] = []
    monkeypatch.setattr(fleet, "fly", lambda _folder, drones, _arguments: flown.append(drones))
    file = tmp_path / "fleet.json"

    result = runner.invoke(make_app(), ["fleet", str(file), "--drones", "1", "--home", "home"])

    assert result.exit_code == 0, result.stderr
    ((registered,),) = (gateway.calls[-1][2],)
    ((drone,),) = flown
    key = PrivateKey.read(drone.pop("signing_key"))
    assert registered.pop("public_key") == key.public_key
    assert registered == {
        "model_id": "dji-matrice-300-rtk",
        "home_station_id": "home",
        "name": "home 1",
    }
    assert drone == {"drone_id": "drn_1"}
    assert "drn_1" in file.read_text()
