"""The agent's settings: arguments first, then the environment."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from skyway.runtime.errors import InvalidSettings


@dataclass(frozen=True, slots=True)
class AgentSettings:
    """Which drones, where their journals lie, and the broker; `parent_fd` ends us when closed."""

    fleet: Path
    journal: Path
    mqtt_url: str
    parent_fd: int | None
    log_level: str


def read_settings(arguments: Sequence[str], environment: Mapping[str, str]) -> AgentSettings:
    """The settings; raises `InvalidSettings` that names what is missing."""
    given = _parser().parse_args(arguments)
    journal = given.journal or environment.get("SKYWAY_AGENT_JOURNAL")
    mqtt_url = given.mqtt_url or environment.get("SKYWAY_MQTT_URL")
    if not journal:
        raise InvalidSettings("where to keep the journals: --journal or SKYWAY_AGENT_JOURNAL")
    if not mqtt_url:
        raise InvalidSettings("where the broker is: --mqtt-url or SKYWAY_MQTT_URL")
    parent_fd = environment.get("SKYWAY_PARENT_FD", "")
    if parent_fd and not parent_fd.isdecimal():
        raise InvalidSettings(f"SKYWAY_PARENT_FD is a file descriptor, not {parent_fd!r}")
    return AgentSettings(
        fleet=Path(given.fleet),
        journal=Path(journal),
        mqtt_url=mqtt_url,
        parent_fd=int(parent_fd) if parent_fd else None,
        log_level=environment.get("SKYWAY_LOG_LEVEL", "INFO"),
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m skyway_drone_agent", description="Serve one drone, or a simulated fleet."
    )
    parser.add_argument(
        "--fleet",
        required=True,
        metavar="FILE",
        help="the answer of POST /v1/providers/{id}/drones: one drone, a list, or {items: [...]}",
    )
    parser.add_argument(
        "--journal", metavar="DIR", help="folder of the journals (or SKYWAY_AGENT_JOURNAL)"
    )
    parser.add_argument(
        "--mqtt-url", metavar="URL", help="mqtt://host:port or mqtts:// (or SKYWAY_MQTT_URL)"
    )
    return parser
