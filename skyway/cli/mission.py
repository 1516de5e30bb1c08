"""`skyway mission`: an operator's commands to a mission."""

import json
from typing import Annotated, Any, Final
from urllib.parse import quote

import typer

from skyway.cli.data_folder import DataOption, data_folder
from skyway.cli.gateway import call_gateway
from skyway.cli.outlook_text import outlook_lines

mission_app: Final = typer.Typer(
    help="Command a mission: hold, resume, divert, return home, cancel, give up.",
    no_args_is_help=True,
)

MissionArgument = Annotated[str, typer.Argument(help="The id of the mission.")]
WhyOption = Annotated[str, typer.Option("--reason", help="Why, for reports and the drone's log.")]
OverrideOption = Annotated[
    bool, typer.Option("--override-failsafe", help="Also while a failsafe of the drone acts.")
]
TryOption = Annotated[
    bool, typer.Option("--dry-run", help="Send nothing; show what the command would do.")
]
AnswerOption = Annotated[bool, typer.Option("--json", help="Print the gateway's answer as JSON.")]


#: The commands that need nothing but a reason, with their help.
_PLAIN: Final = {
    "hold": "Have the drone stand at its next landing until it is resumed.",
    "resume": "Let a held drone go on.",
    "cancel": "Cancel the mission; packages on board are brought back.",
    "give-up": "End a mission in doubt, when people know that its drone will not report.",
}


def _add_plain(name: str, about: str) -> None:
    @mission_app.command(name, help=about)
    def give(
        mission: MissionArgument,
        reason: WhyOption,
        dry_run: TryOption = False,
        as_json: AnswerOption = False,
        data: DataOption = None,
    ) -> None:
        body = {"command": name.upper().replace("-", "_"), "reason": reason}
        _command(mission, body, dry_run=dry_run, as_json=as_json, data=data)


for _name, _about in _PLAIN.items():
    _add_plain(_name, _about)


@mission_app.command("divert")
def divert(
    mission: MissionArgument,
    station: Annotated[str, typer.Argument(help="The station to land at.")],
    reason: WhyOption,
    override_failsafe: OverrideOption = False,
    dry_run: TryOption = False,
    as_json: AnswerOption = False,
    data: DataOption = None,
) -> None:
    """Have the drone land at a station and wait there."""
    body = {
        "command": "DIVERT",
        "station_id": station,
        "reason": reason,
        "overrides_failsafe": override_failsafe,
    }
    _command(mission, body, dry_run=dry_run, as_json=as_json, data=data)


@mission_app.command("return-home")
def return_home(
    mission: MissionArgument,
    reason: WhyOption,
    override_failsafe: OverrideOption = False,
    dry_run: TryOption = False,
    as_json: AnswerOption = False,
    data: DataOption = None,
) -> None:
    """Call the drone home with its packages."""
    body = {
        "command": "RETURN_HOME",
        "reason": reason,
        "overrides_failsafe": override_failsafe,
    }
    _command(mission, body, dry_run=dry_run, as_json=as_json, data=data)


def _command(
    mission: str, body: dict[str, Any], *, dry_run: bool, as_json: bool, data: DataOption
) -> None:
    path = f"/v1/missions/{quote(mission, safe='')}/commands"
    answer = call_gateway(
        "POST",
        f"{path}?dry_run=true" if dry_run else path,
        folder=data_folder(data),
        body=json.dumps(body).encode(),
    )
    if as_json:
        typer.echo(json.dumps(answer, indent=2))
    else:
        typer.echo("\n".join(outlook_lines(answer)) if dry_run else _line(answer))


def _line(answer: dict[str, Any]) -> str:
    said = f"{answer['mission_id']}: {answer['command']} is accepted"
    if (waits := answer["waits_for"]) is not None:
        return f"{said}; it waits until the failsafe {waits['failsafe']} ({waits['fault']}) ends"
    if answer["instruction_id"] is None:
        return f"{said}; the drone gets it with its next plan"
    return f"{said}; the drone gets instruction {answer['instruction_id']}"
