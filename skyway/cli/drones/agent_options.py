"""The options of `skyway drone` and `skyway fleet` that are passed on to the agent."""

from pathlib import Path
from typing import Annotated

import typer

FileArgument = Annotated[
    Path | None,
    typer.Argument(metavar="[FILE]", help="The answer of POST /v1/providers/{id}/drones."),
]

_ENROLMENT = "Enrolment"

EnrolOption = Annotated[
    str | None,
    typer.Option(
        metavar="TOKEN",
        envvar="SKYWAY_ENROLMENT_TOKEN",
        show_envvar=True,
        help="Exchange this token for the drone's credentials, once.",
        rich_help_panel=_ENROLMENT,
    ),
]

ApiOption = Annotated[
    str | None,
    typer.Option(
        help="The gateway's URL; without it SKYWAY_GATEWAY_URL.", rich_help_panel=_ENROLMENT
    ),
]

RotateOption = Annotated[
    bool,
    typer.Option(
        "--rotate",
        help="Rotate the credentials before the drone flies.",
        rich_help_panel=_ENROLMENT,
    ),
]

_DISTURBED = "Differences from the plan"

ScenarioOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE",
        help="A day with wind and faults: calm, windy, stormy, ... or a file.",
        rich_help_panel=_DISTURBED,
    ),
]

SeedOption = Annotated[
    int | None,
    typer.Option(
        min=0,
        help="The seed of the scenario; each seed is another day.",
        rich_help_panel=_DISTURBED,
    ),
]

FlightTimeOption = Annotated[
    float | None,
    typer.Option(help="Flight times are multiplied by this.", rich_help_panel=_DISTURBED),
]

FlightEnergyOption = Annotated[
    float | None,
    typer.Option(help="Flight energies are multiplied by this.", rich_help_panel=_DISTURBED),
]

ChargeTimeOption = Annotated[
    float | None,
    typer.Option(help="Recharge times are multiplied by this.", rich_help_panel=_DISTURBED),
]

AbsentOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="STATION",
        help="A station without a recipient; repeat it for more.",
        rich_help_panel=_DISTURBED,
    ),
]

_REAL = "A real drone (docs/mavlink.md)"

VehicleOption = Annotated[
    str | None,
    typer.Option(
        metavar="mavlink:ADDRESS",
        help="The autopilot, such as mavlink:udpin:127.0.0.1:14550.",
        rich_help_panel=_REAL,
    ),
]

PayloadOption = Annotated[
    str | None,
    typer.Option(
        metavar="RELEASE",
        help="The package release: gripper:NUMBER or servo:NUMBER:MICROSECONDS.",
        rich_help_panel=_REAL,
    ),
]

AltitudeOption = Annotated[
    float | None, typer.Option(help="Metres above the take-off point.", rich_help_panel=_REAL)
]


def agent_arguments(options: dict[str, object], absent: list[str] | None) -> list[str]:
    """The options as arguments of the agent, without options that are not given."""
    given = [f"--{name}={value}" for name, value in options.items() if value is not None]
    return given + [f"--absent-station={station}" for station in absent or ()]
