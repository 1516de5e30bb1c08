"""The agent's settings: arguments first, then the environment."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from skyway.complaints import sentence_of
from skyway.errors import InvalidInput
from skyway.ids import DroneId
from skyway.runtime.errors import InvalidSettings
from skyway_drone_agent.journal.records import Placed
from skyway_drone_agent.mavlink.settings import MavlinkSettings, PayloadRelease
from skyway_drone_agent.simulated.disturbances import (
    UNDISTURBED,
    Disturbances,
    changed,
    read_scenario,
    scenario_names,
)

#: Keys of a scenario that have an option each, which comes before what the file says.
_OPTIONS: Final = ("seed", "flight_time_factor", "flight_energy_factor", "charge_time_factor")


@dataclass(frozen=True, slots=True)
class EnrolmentSettings:
    """The token to exchange, the cloud's URL, a single drone, and whether to rotate now."""

    token: str | None = field(repr=False)
    api_url: str
    drone_id: DroneId | None
    is_rotation_requested: bool


@dataclass(frozen=True, slots=True)
class AgentSettings:
    """The drones, the folder of their journals, and the broker.

    Without `mqtt_url` each drone connects where its enrolment says. Without a fleet file the agent
    serves the drones that enrolled here. The agent stops when `parent_fd` is closed. With
    `log_file` the log goes there, and standard error gets a line a minute for people.
    """

    fleet: Path | None
    enrolment: EnrolmentSettings
    journal: Path
    mqtt_url: str | None
    parent_fd: int | None
    log_level: str
    log_file: Path | None
    disturbances: Disturbances
    mavlink: MavlinkSettings | None = None
    placed: Placed | None = None


def read_settings(arguments: Sequence[str], environment: Mapping[str, str]) -> AgentSettings:
    """The settings; an `InvalidSettings` or `InvalidInput` names what is missing or wrong."""
    given = _parser().parse_args(arguments)
    journal = given.journal or environment.get("SKYWAY_AGENT_JOURNAL")
    mqtt_url = given.mqtt_url or environment.get("SKYWAY_MQTT_URL")
    if not journal:
        raise InvalidSettings(
            "the folder of the journals is missing: --journal or SKYWAY_AGENT_JOURNAL"
        )
    parent_fd = environment.get("SKYWAY_PARENT_FD", "")
    if parent_fd and not parent_fd.isdecimal():
        raise InvalidSettings(f"SKYWAY_PARENT_FD is a file descriptor, not {parent_fd!r}")
    return AgentSettings(
        fleet=None if given.fleet is None else Path(given.fleet),
        enrolment=_enrolment(given, environment),
        journal=Path(journal),
        mqtt_url=mqtt_url or None,
        parent_fd=int(parent_fd) if parent_fd else None,
        log_level=environment.get("SKYWAY_LOG_LEVEL", "INFO"),
        log_file=Path(log_file) if (log_file := environment.get("SKYWAY_AGENT_LOG")) else None,
        disturbances=_disturbances(given),
        mavlink=_mavlink(given),
        placed=_placed(given),
    )


def _placed(given: argparse.Namespace) -> Placed | None:
    if (given.placed_at is None) != (given.position is None):
        raise InvalidSettings("--placed-at and --position belong together")
    if given.placed_at is None:
        return None
    try:
        return Placed.model_validate(
            {"station_id": given.placed_at, "position": tuple(given.position)}
        )
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise InvalidInput("--position", f"{sentence_of(first)}, not {first['input']!r}") from error


def _mavlink(given: argparse.Namespace) -> MavlinkSettings | None:
    if given.vehicle is None:
        return None
    kind, _, address = given.vehicle.partition(":")
    if kind != "mavlink" or not address:
        raise InvalidSettings(f"a vehicle is mavlink:ADDRESS, not {given.vehicle!r}")
    payload = PayloadRelease.parse(given.payload)
    return MavlinkSettings(address, payload, given.altitude_m, system_id=given.system_id)


def _enrolment(given: argparse.Namespace, environment: Mapping[str, str]) -> EnrolmentSettings:
    if given.fleet is not None and given.rotate:
        raise InvalidSettings("--rotate is for drones that enrolled, not for those of --fleet")
    # Everybody on the machine can read arguments; only this user can read the environment.
    token = given.enrol or environment.get("SKYWAY_ENROLMENT_TOKEN")
    api_url = given.api or environment.get("SKYWAY_GATEWAY_URL")
    if given.fleet is None and token and not api_url:
        raise InvalidSettings("the cloud's URL is missing: --api or SKYWAY_GATEWAY_URL")
    return EnrolmentSettings(
        token or None,
        api_url or "",
        drone_id=None if given.drone_id is None else DroneId(given.drone_id),
        is_rotation_requested=given.rotate,
    )


def _disturbances(given: argparse.Namespace) -> Disturbances:
    scenario = UNDISTURBED if given.scenario is None else read_scenario(given.scenario)
    options: dict[str, Any] = {  # numbers and station ids
        key: getattr(given, key) for key in _OPTIONS if getattr(given, key) is not None
    }
    if given.absent_station:
        options["absent_station_ids"] = given.absent_station
    return changed(scenario, options) if options else scenario


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m skyway_drone_agent", description="Serve one drone, or a simulated fleet."
    )
    parser.add_argument(
        "--fleet",
        metavar="FILE",
        help="the answer of POST /v1/providers/{id}/drones: one drone, a list, or {items: [...]};"
        " without it: the drones that enrolled in the journals' folder",
    )
    _add_enrolment(parser)
    parser.add_argument(
        "--journal", metavar="DIR", help="folder of the journals (or SKYWAY_AGENT_JOURNAL)"
    )
    parser.add_argument(
        "--mqtt-url",
        metavar="URL",
        help="mqtt://host:port or mqtts:// (or SKYWAY_MQTT_URL); without it: as the enrolment says",
    )
    _add_placing(parser)
    _add_vehicle(parser)
    _add_disturbances(parser)
    return parser


def _add_placing(parser: argparse.ArgumentParser) -> None:
    placing = parser.add_argument_group("a drone that was down (docs/failsafes.md)")
    placing.add_argument(
        "--placed-at", metavar="STATION", help="people fetched it, emptied it, and put it there"
    )
    placing.add_argument(
        "--position", nargs=2, type=float, metavar=("LON", "LAT"), help="where that is, degrees"
    )


def _add_vehicle(parser: argparse.ArgumentParser) -> None:
    vehicle = parser.add_argument_group("a real drone (docs/mavlink.md)")
    vehicle.add_argument(
        "--vehicle",
        metavar="mavlink:ADDRESS",
        help="its autopilot, in pymavlink's form: mavlink:udpin:127.0.0.1:14550",
    )
    vehicle.add_argument(
        "--payload",
        default="gripper:1",
        metavar="RELEASE",
        help="what lets go of packages: gripper:NUMBER or servo:NUMBER:MICROSECONDS",
    )
    vehicle.add_argument(
        "--altitude-m", type=float, default=60.0, metavar="M", help="above the take-off"
    )
    vehicle.add_argument(
        "--system-id", type=int, metavar="N", help="its autopilot's, if the link has several"
    )


def _add_enrolment(parser: argparse.ArgumentParser) -> None:
    enrolment = parser.add_argument_group("enrolment")
    enrolment.add_argument(
        "--enrol",
        metavar="TOKEN",
        help="exchange this token once and keep the credentials (or SKYWAY_ENROLMENT_TOKEN)",
    )
    enrolment.add_argument(
        "--api", metavar="URL", help="the cloud's https://host (or SKYWAY_GATEWAY_URL)"
    )
    enrolment.add_argument(
        "--drone-id", metavar="ID", help="serve only this one of the drones that enrolled here"
    )
    enrolment.add_argument(
        "--rotate", action="store_true", help="change the drones' credentials before they serve"
    )


def _add_disturbances(parser: argparse.ArgumentParser) -> None:
    """The options for disturbances, with the same names as in `skyway fleet`."""
    disturbed = parser.add_argument_group("disturbances of simulated drones")
    disturbed.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        help=f"{', '.join(scenario_names())}, or a file (docs/scenarios.md)",
    )
    disturbed.add_argument(
        "--seed", type=int, metavar="N", help="seed of all chance in the scenario"
    )
    for option, what in (
        ("--flight-time-factor", "flights take so many times as long as planned"),
        ("--flight-energy-factor", "flights take so many times the energy planned"),
        ("--charge-time-factor", "recharges take so many times as long as planned"),
    ):
        disturbed.add_argument(option, type=float, metavar="FACTOR", help=what)
    disturbed.add_argument(
        "--absent-station",
        action="append",
        default=[],
        metavar="STATION",
        help="no recipient is at this station; may be given several times",
    )
