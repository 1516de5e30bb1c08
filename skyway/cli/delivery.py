"""`skyway request` and `skyway track`: a customer at the terminal."""

import json
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import httpx
import typer
from rich.console import Console

from skyway.cli.data_folder import DataFolder, data_folder
from skyway.cli.gateway import call_gateway, fail, read_keys
from skyway.cli.system.up import DataOption

_CUSTOMER_KEY = "SKYWAY_CUSTOMER_KEY"

#: After these a delivery says no more.
_LAST_WORDS = frozenset(
    f"delivery.{end}"
    for end in ("completed", "partially_completed", "failed", "rejected", "cancelled")
)

#: After these there is a plan to look at.
_PLANS = frozenset({"delivery.planned", "delivery.replanned"})


def request_command(
    pickup: Annotated[str | None, typer.Argument(help="The pickup station.")] = None,
    package: Annotated[
        list[str] | None,
        typer.Option("--package", "-p", help="DESTINATION=MASS_KG; once for each package."),
    ] = None,
    file: Annotated[
        Path | None, typer.Option(help="A delivery request as JSON, instead of the above.")
    ] = None,
    objective: Annotated[str, typer.Option(help="fastest, cheapest or greenest.")] = "fastest",
    follow: Annotated[bool, typer.Option("--follow", help="Track it to its end.")] = False,
    data: DataOption = None,
) -> None:
    """Request a delivery, and print its id."""
    folder = data_folder(data)
    if file is not None:
        body = file.read_bytes()
    else:
        if not pickup or not package:
            fail("give a pickup station and at least one --package DESTINATION=MASS_KG, or --file")
        body = json.dumps(_request(pickup, package, objective)).encode()
    answer = _create(folder, body)
    typer.echo(answer["delivery_id"])
    if follow:
        _follow(folder, answer["delivery_id"])


def track_command(
    delivery_id: Annotated[str, typer.Argument(help="As `skyway request` printed it.")],
    data: DataOption = None,
) -> None:
    """Print a delivery's events as they happen, until it ends."""
    _follow(data_folder(data), delivery_id)


def _request(pickup: str, packages: list[str], objective: str) -> dict[str, Any]:
    asked = []
    for number, text in enumerate(packages, start=1):
        destination, equals, mass = text.partition("=")
        try:
            mass_kg = float(mass) if equals else 1.0
        except ValueError:
            fail(f"--package {text}: {mass!r} is not a mass in kg")
        place = {"station_id": destination}
        asked.append({"package_id": f"p{number}", "mass_kg": mass_kg, "destination": place})
    return {
        "pickup": {"station_id": pickup},
        "packages": asked,
        "qos": {"objective": objective},
    }


def _create(folder: DataFolder, body: bytes) -> dict[str, Any]:
    answer: dict[str, Any] = call_gateway(
        "POST",
        "/v1/deliveries",
        key_name=_CUSTOMER_KEY,
        folder=folder,
        body=body,
        idempotency_key=str(uuid.uuid4()),
    )
    return answer


def _follow(folder: DataFolder, delivery_id: str) -> None:
    console = Console()
    call_gateway("GET", f"/v1/deliveries/{delivery_id}", key_name=_CUSTOMER_KEY, folder=folder)
    settings = read_keys(folder)
    url = f"{settings['SKYWAY_GATEWAY_URL']}/v1/deliveries/{delivery_id}/events"
    headers = {"Authorization": f"Bearer {settings[_CUSTOMER_KEY]}"}
    last_type = ""
    while last_type not in _LAST_WORDS:
        try:
            for event_type in _print_events(console, url, headers):
                last_type = event_type
                if last_type in _PLANS:
                    _print_proofs(console, folder, delivery_id)
        except httpx.TransportError as error:
            # The stream broke; the next one goes on after the last event that was printed.
            console.print(f"[dim]{error}; connecting again[/]")


def _print_events(console: Console, url: str, headers: dict[str, str]) -> Iterator[str]:
    """Print what comes until the stream ends, and give the type of each event.

    Remembers the place in `headers` for the next stream.
    """
    with httpx.stream("GET", url, headers=headers, timeout=httpx.Timeout(10, read=None)) as lines:
        for line in lines.iter_lines():
            name, _, value = line.partition(": ")
            if name == "id":
                headers["Last-Event-ID"] = value
            elif name == "data":
                event = json.loads(value)
                event_type: str = event["type"]
                console.print(f"{event['occurred_at']}  {event_type}  {json.dumps(event['data'])}")
                yield event_type
                if event_type in _LAST_WORDS:
                    break


def _print_proofs(console: Console, folder: DataFolder, delivery_id: str) -> None:
    """Say of each mission's plan whether it is proven to be the earliest."""
    path = f"/v1/deliveries/{delivery_id}/plan"
    planned = call_gateway("GET", path, key_name=_CUSTOMER_KEY, folder=folder)
    for mission in planned["missions"]:
        plan = mission["plan"]
        console.print(f"  plan of {mission['drone_id']}: {proof_of(plan)}", highlight=False)


def proof_of(plan: Mapping[str, Any]) -> str:  # a plan as JSON
    """Whether the plan's time is proven to be the earliest, or how much earlier one could be."""
    delivered_s, bound_s = plan.get("delivery_time_s"), plan.get("lower_bound_s")
    if plan.get("status") == "optimal":
        return "proven optimal: no plan delivers earlier"
    if delivered_s is None or bound_s is None:
        return "not proven optimal"
    earlier_s = delivered_s - bound_s
    return f"not proven optimal: another plan could be up to {earlier_s:,.0f} s earlier"
