"""Arguments come before the environment, and missing settings are named."""

from pathlib import Path

import pytest
from skyway_drone_agent.settings import read_settings
from skyway_drone_agent.simulated.disturbances import Disturbances

from skyway.errors import InvalidInput
from skyway.ids import StationId
from skyway.runtime.errors import InvalidSettings

FLEET = ["--fleet", "fleet.json"]
PLACES = ["--journal", "here", "--mqtt-url", "mqtt://b:1"]


def test_arguments_come_before_the_environment() -> None:
    environment = {"SKYWAY_AGENT_JOURNAL": "there", "SKYWAY_MQTT_URL": "mqtt://there:1"}

    settings = read_settings([*FLEET, "--journal", "here"], environment)

    assert (settings.journal, settings.mqtt_url) == (Path("here"), "mqtt://there:1")
    assert settings.parent_fd is None


def test_nothing_is_disturbed_unless_asked_for() -> None:
    settings = read_settings([*FLEET, *PLACES], {})

    assert settings.disturbances == Disturbances()


def test_disturbances_are_read_from_the_arguments() -> None:
    disturbed = ["--flight-time-factor", "1.2", "--flight-energy-factor", "1.3"]
    disturbed += ["--charge-time-factor", "2", "--absent-station", "a", "--absent-station", "b"]

    settings = read_settings([*FLEET, *PLACES, *disturbed], {})

    assert settings.disturbances == Disturbances(
        flight_time_factor=1.2,
        flight_energy_factor=1.3,
        charge_time_factor=2.0,
        absent_station_ids=frozenset({StationId("a"), StationId("b")}),
    )


def test_a_factor_that_is_not_above_zero_is_named() -> None:
    with pytest.raises(InvalidInput, match=r"charge_time_factor: must be above 0, not 0"):
        read_settings([*FLEET, *PLACES, "--charge-time-factor", "0"], {})


@pytest.mark.parametrize(
    ("environment", "named"),
    [
        ({"SKYWAY_MQTT_URL": "mqtt://b:1"}, "SKYWAY_AGENT_JOURNAL"),
        (
            {
                "SKYWAY_AGENT_JOURNAL": "here",
                "SKYWAY_MQTT_URL": "mqtt://b:1",
                "SKYWAY_PARENT_FD": "x",
            },
            "SKYWAY_PARENT_FD",
        ),
    ],
)
def test_missing_and_wrong_settings_are_named(environment: dict[str, str], named: str) -> None:
    with pytest.raises(InvalidSettings, match=named):
        read_settings(FLEET, environment)


def test_options_come_before_what_the_scenario_says() -> None:
    scenario = ["--scenario", "cold", "--seed", "7", "--charge-time-factor", "2"]

    settings = read_settings([*FLEET, *PLACES, *scenario], {})

    assert settings.disturbances.battery.temperature_c == -8.0
    assert (settings.disturbances.seed, settings.disturbances.charge_time_factor) == (7, 2.0)


def test_without_a_fleet_file_the_enrolled_drones_are_served() -> None:
    settings = read_settings(PLACES, {})

    assert settings.fleet is None
    assert settings.enrolment.token is None


def test_a_token_may_come_from_the_environment_and_is_not_shown() -> None:
    environment = {"SKYWAY_ENROLMENT_TOKEN": "enr_x", "SKYWAY_GATEWAY_URL": "http://here"}

    settings = read_settings(PLACES, environment)

    assert (settings.enrolment.token, settings.enrolment.api_url) == ("enr_x", "http://here")
    assert "enr_x" not in repr(settings)


def test_a_token_needs_a_place_to_exchange_it() -> None:
    with pytest.raises(InvalidSettings, match="--api"):
        read_settings([*PLACES, "--enrol", "enr_x"], {})


def test_drones_of_a_file_do_not_rotate() -> None:
    with pytest.raises(InvalidSettings, match="--rotate"):
        read_settings([*FLEET, *PLACES, "--rotate"], {})
