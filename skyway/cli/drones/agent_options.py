"""The options of `skyway drone` and `skyway fleet` that the agent is told as they come."""

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
    typer.Option(help="Where; else SKYWAY_GATEWAY_URL.", rich_help_panel=_ENROLMENT),
]

RotateOption = Annotated[
    bool,
    typer.Option(
        "--rotate", help="Change its credentials before it flies.", rich_help_panel=_ENROLMENT
    ),
]

_DISTURBED = "What goes otherwise than planned"

ScenarioOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE",
        help="A day with its wind and faults: calm, windy, stormy, ... or a file.",
        rich_help_panel=_DISTURBED,
    ),
]

SeedOption = Annotated[
    int | None,
    typer.Option(
        min=0, help="Which of the scenario's many days it is.", rich_help_panel=_DISTURBED
    ),
]

FlightTimeOption = Annotated[
    float | None,
    typer.Option(help="Flights take so many times as long.", rich_help_panel=_DISTURBED),
]

FlightEnergyOption = Annotated[
    float | None,
    typer.Option(help="Flights take so many times the energy.", rich_help_panel=_DISTURBED),
]

ChargeTimeOption = Annotated[
    float | None,
    typer.Option(help="Recharges take so many times as long.", rich_help_panel=_DISTURBED),
]

AbsentOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="STATION",
        help="Nobody is there to take packages; may be given again.",
        rich_help_panel=_DISTURBED,
    ),
]

_REAL = "A real drone (docs/mavlink.md)"

VehicleOption = Annotated[
    str | None,
    typer.Option(
        metavar="mavlink:ADDRESS",
        help="Its autopilot: mavlink:udpin:127.0.0.1:14550.",
        rich_help_panel=_REAL,
    ),
]

PayloadOption = Annotated[
    str | None,
    typer.Option(
        metavar="RELEASE",
        help="What lets go: gripper:NUMBER or servo:NUMBER:MICROSECONDS.",
        rich_help_panel=_REAL,
    ),
]

AltitudeOption = Annotated[
    float | None, typer.Option(help="Metres above the take-off.", rich_help_panel=_REAL)
]


def agent_arguments(options: dict[str, object], absent: list[str] | None) -> list[str]:
    """Options as the agent's arguments; what is not given is left to it and the scenario."""
    given = [f"--{name}={value}" for name, value in options.items() if value is not None]
    return given + [f"--absent-station={station}" for station in absent or ()]
