"""Arguments come before the environment, and what is missing is named."""

from pathlib import Path

import pytest
from skyway_drone_agent.settings import read_settings

from skyway.runtime.errors import InvalidSettings

FLEET = ["--fleet", "fleet.json"]


def test_arguments_come_before_the_environment() -> None:
    environment = {"SKYWAY_AGENT_JOURNAL": "there", "SKYWAY_MQTT_URL": "mqtt://there:1"}

    settings = read_settings([*FLEET, "--journal", "here"], environment)

    assert (settings.journal, settings.mqtt_url) == (Path("here"), "mqtt://there:1")
    assert settings.parent_fd is None


@pytest.mark.parametrize(
    ("environment", "named"),
    [
        ({"SKYWAY_MQTT_URL": "mqtt://b:1"}, "SKYWAY_AGENT_JOURNAL"),
        ({"SKYWAY_AGENT_JOURNAL": "here"}, "SKYWAY_MQTT_URL"),
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
def test_what_is_missing_or_wrong_is_named(environment: dict[str, str], named: str) -> None:
    with pytest.raises(InvalidSettings, match=named):
        read_settings(FLEET, environment)
