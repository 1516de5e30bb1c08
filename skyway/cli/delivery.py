"""`skyway request`, `skyway accept` and `skyway track`: a customer's deliveries at the terminal."""

import json
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from datetime import datetime
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.event_text import event_text
from skyway.cli.gateway import call_gateway, fail, http, read_keys
from skyway.cli.request_options import (
    CUSTOMER_KEY,
    EarliestPickupOption,
    FileOption,
    FirmWithinOption,
    LatestOption,
    LatestPickupOption,
    MayBeLaterOption,
    MayChangeProviderOption,
    NotBeforeOption,
    ObjectiveOption,
    PackageOption,
    PickupArgument,
    PickupWithinOption,
    PoolingOption,
    PoolingWaitOption,
    PriorityOption,
    PromiseOption,
    RequestOptions,
)

if TYPE_CHECKING:
    from rich.console import Console

#: The last event of a delivery, and the exit code of the command that followed it.
_EXIT_CODES: Final = {
    "delivery.completed": 0,
    "delivery.partially_completed": 3,
    "delivery.rejected": 1,
    "delivery.failed": 1,
    "delivery.cancelled": 1,
}
_EXIT_CODES_IN_WORDS: Final = (
    "Exit code: 0 COMPLETED, 3 PARTIALLY_COMPLETED, 1 REJECTED, FAILED or CANCELLED."
)

_FollowOption = Annotated[
    bool, typer.Option("--follow", help=f"Track it to its end. {_EXIT_CODES_IN_WORDS}")
]

#: After these events there is a plan to show.
_PLAN_EVENTS: Final = frozenset({"delivery.planned", "delivery.replanned"})


def request_command(
    pickup: PickupArgument = None,
    package: PackageOption = None,
    file: FileOption = None,
    objective: ObjectiveOption = "FASTEST",
    priority: PriorityOption = "STANDARD",
    promise: PromiseOption = "P90",
    pooling: PoolingOption = False,
    pooling_wait_s: PoolingWaitOption = None,
    pickup_within_m: PickupWithinOption = None,
    may_be_later_s: MayBeLaterOption = 0.0,
    firm_within_s: FirmWithinOption = 0.0,
    may_change_provider: MayChangeProviderOption = False,
    earliest_pickup: EarliestPickupOption = None,
    latest_pickup: LatestPickupOption = None,
    not_before: NotBeforeOption = None,
    latest: LatestOption = None,
    follow: _FollowOption = False,
    data: DataOption = None,
) -> None:
    """Request a delivery and print its id.

    A MOMENT is in fleet time: 2026-03-02T14:00:00Z, or +2h30m from now.
    """
    folder = data_folder(data)
    options = RequestOptions(
        pickup=pickup,
        packages=package or (),
        file=file,
        objective=objective,
        priority=priority,
        promise=promise,
        pooling=pooling,
        pooling_wait_s=pooling_wait_s,
        pickup_within_m=pickup_within_m,
        may_be_later_s=may_be_later_s,
        firm_within_s=firm_within_s,
        may_change_provider=may_change_provider,
        earliest_pickup=earliest_pickup,
        latest_pickup=latest_pickup,
        not_before=not_before or (),
        latest=latest or (),
    )
    request = options.document(folder)
    _name_what_is_missing(folder)
    _create(folder, request, follow=follow, fields=options.fields)


def accept_command(
    quote_id: Annotated[str, typer.Argument(help="The id that `skyway quote` printed.")],
    offer_id: Annotated[str, typer.Argument(help="An offer of the quote.")],
    follow: _FollowOption = False,
    data: DataOption = None,
) -> None:
    """Accept an offer and print the id of its delivery."""
    offer = {"quote_id": quote_id, "offer_id": offer_id}
    _create(data_folder(data), offer, follow=follow)


def track_command(
    delivery_id: Annotated[str, typer.Argument(help="The id that `skyway request` printed.")],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print each event as one line of JSON, for programs.")
    ] = False,
    data: DataOption = None,
) -> None:
    """Print what happens to a delivery, in fleet time, until it ends.

    Exit code: 0 COMPLETED, 3 PARTIALLY_COMPLETED, 1 REJECTED, FAILED or CANCELLED.
    """
    _follow(data_folder(data), delivery_id, as_json=as_json)


def proof_of(plan: Mapping[str, Any]) -> str:  # a plan as JSON
    """Whether the plan is proven to deliver earliest, or how much earlier another plan could be."""
    delivered_s, bound_s = plan.get("delivery_time_s"), plan.get("lower_bound_s")
    if plan.get("status") == "optimal":
        return "proven optimal: no plan delivers earlier"
    if delivered_s is None or bound_s is None:
        return "not proven optimal"
    earlier_s = delivered_s - bound_s
    return f"not proven optimal: another plan could be up to {earlier_s:,.0f} s earlier"


def _name_what_is_missing(folder: DataFolder) -> None:
    """Say what an empty system lacks.

    Without a network the command ends. Without a provider it goes on: the delivery waits for one.
    """
    if not _list(folder, "/v1/networks"):
        fail("no network is published: skyway network import bundled")
    if not _list(folder, "/v1/providers"):
        typer.echo(
            "no provider is registered yet, so no drone can fly this: skyway fleet --drones 10",
            err=True,
        )


def _list(folder: DataFolder, path: str) -> list[Any]:
    """The first item of a list; Any: the route documents the item's JSON."""
    page = call_gateway("GET", f"{path}?limit=1", key_name=CUSTOMER_KEY, folder=folder)
    items: list[Any] = page["items"]
    return items


def _create(
    folder: DataFolder,
    ordered: Mapping[str, Any],  # a delivery request or an accepted offer as JSON
    *,
    follow: bool,
    fields: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Create a delivery and print its id; with `follow`, print its events until it ends."""
    answer = call_gateway(
        "POST",
        "/v1/deliveries",
        key_name=CUSTOMER_KEY,
        folder=folder,
        body=json.dumps(ordered).encode(),
        idempotency_key=str(uuid.uuid4()),
        options=fields,
    )
    typer.echo(answer["delivery_id"])
    if follow:
        _follow(folder, answer["delivery_id"])


def _follow(folder: DataFolder, delivery_id: str, *, as_json: bool = False) -> None:
    """Print events until the delivery ends; ends the command unless the delivery COMPLETED.

    At a terminal, a line below the events says how far the delivery is and when it comes.
    """
    import httpx
    from rich.console import Console

    from skyway.cli.progress_text import progress_line

    console = Console()
    call_gateway("GET", f"/v1/deliveries/{delivery_id}", key_name=CUSTOMER_KEY, folder=folder)
    settings = read_keys(folder)
    url = f"{settings['SKYWAY_GATEWAY_URL']}/v1/deliveries/{delivery_id}"
    headers = {"Authorization": f"Bearer {settings[CUSTOMER_KEY]}"}
    key, last_type = dict(headers), ""
    has_line = console.is_terminal and not as_json
    with progress_line(console, _clock(folder)) if has_line else nullcontext() as progress:
        while last_type not in _EXIT_CODES:
            try:
                for event_type in _print_events(console, url, headers, as_json=as_json):
                    last_type = event_type or last_type
                    if event_type in _PLAN_EVENTS and not as_json:
                        _print_proofs(console, folder, delivery_id)
                    if progress is not None:
                        answer = http().get(url, headers=key, timeout=10)
                        progress.show(answer.raise_for_status().json())
            except (httpx.TransportError, httpx.HTTPStatusError) as error:
                # The next stream continues after the last event that was printed.
                typer.echo(f"{error}; connecting again", err=True)
    if exit_code := _EXIT_CODES[last_type]:
        raise typer.Exit(exit_code)


def _clock(folder: DataFolder) -> Callable[[], datetime]:
    """Fleet time, by this machine's clock and the gateway's anchor."""
    from pydantic import TypeAdapter

    from skyway.runtime.clock import AnchoredClock

    answer = call_gateway("GET", "/v1/clock", key_name=CUSTOMER_KEY, folder=folder)
    anchor = {name: answer[name] for name in ("fleet_at", "wall_at", "rate")}
    return TypeAdapter(AnchoredClock).validate_python(anchor).now


def _print_events(
    console: "Console", url: str, headers: dict[str, str], *, as_json: bool
) -> Iterator[str]:
    """Print the events of a delivery's stream, and yield the type of each; "" at a heartbeat.

    `headers` keep the id of the last event, so that the next stream continues there.
    """
    import httpx

    timeout = httpx.Timeout(10, read=None)
    with http().stream("GET", f"{url}/events", headers=headers, timeout=timeout) as lines:
        for line in lines.iter_lines():
            name, _, value = line.partition(": ")
            if name == "id":
                headers["Last-Event-ID"] = value
            elif name == "data":
                event = json.loads(value)
                event_type: str = event["type"]
                line_of_event = value if as_json else event_text(event)
                console.print(line_of_event, highlight=False, markup=False, soft_wrap=True)
                yield event_type
                if event_type in _EXIT_CODES:
                    break
            elif line.startswith(":"):
                yield ""


def _print_proofs(console: "Console", folder: DataFolder, delivery_id: str) -> None:
    """Say of each mission's plan whether it is proven to deliver earliest."""
    path = f"/v1/deliveries/{delivery_id}/plan"
    planned = call_gateway("GET", path, key_name=CUSTOMER_KEY, folder=folder)
    for mission in planned["missions"]:
        plan = mission["plan"]
        console.print(f"  plan of {mission['drone_id']}: {proof_of(plan)}", highlight=False)
