"""`skyway quote`: what a delivery would cost, and when it would arrive."""

import json
import uuid
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.gateway import call_gateway
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
    PoolingOption,
    PoolingWaitOption,
    PriorityOption,
    PromiseOption,
    RequestOptions,
)


def quote_command(
    pickup: PickupArgument = None,
    package: PackageOption = None,
    file: FileOption = None,
    objective: ObjectiveOption = "FASTEST",
    priority: PriorityOption = "STANDARD",
    promise: PromiseOption = "P90",
    pooling: PoolingOption = False,
    pooling_wait_s: PoolingWaitOption = None,
    may_be_later_s: MayBeLaterOption = 0.0,
    firm_within_s: FirmWithinOption = 0.0,
    may_change_provider: MayChangeProviderOption = False,
    earliest_pickup: EarliestPickupOption = None,
    latest_pickup: LatestPickupOption = None,
    not_before: NotBeforeOption = None,
    latest: LatestOption = None,
    hold: Annotated[
        bool,
        typer.Option(
            "--hold", help="Keep the drones and pads of the best 3 offers until they expire."
        ),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the gateway's answer as JSON.")
    ] = False,
    data: DataOption = None,
) -> None:
    """Ask what providers offer for a delivery request; the best offer comes first.

    Exit code: 0 with offers, 1 without.
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
        may_be_later_s=may_be_later_s,
        firm_within_s=firm_within_s,
        may_change_provider=may_change_provider,
        earliest_pickup=earliest_pickup,
        latest_pickup=latest_pickup,
        not_before=not_before or (),
        latest=latest or (),
    )
    request = options.document(folder)
    answer = call_gateway(
        "POST",
        "/v1/quotes",
        key_name=CUSTOMER_KEY,
        folder=folder,
        body=json.dumps(request | {"hold": True} if hold else request).encode(),
        idempotency_key=str(uuid.uuid4()),
        options=options.fields,
    )
    if as_json:
        typer.echo(json.dumps(answer, indent=2))
    else:
        names = _provider_names(folder)
        for line in _offers(answer, names):
            typer.echo(line)
        for line in _reasons(answer, names):
            typer.echo(line, err=True)
    if not answer["offers"]:
        raise typer.Exit(1)


def price_in_words(price: dict[str, Any]) -> str:
    """An amount of money as JSON, such as "12.20 USD"."""
    return f"{price['amount'] / 100:.2f} {price['currency']}"


def _provider_names(folder: DataFolder) -> dict[str, str]:
    """The names of the first 200 providers, by their ids."""
    from skyway.bounds import printable

    page = call_gateway("GET", "/v1/providers?limit=200", key_name=CUSTOMER_KEY, folder=folder)
    # Providers choose their names, and this is a customer's terminal.
    return {each["provider_id"]: str(printable(each["name"])) for each in page["items"]}


def _offers(answer: dict[str, Any], names: dict[str, str]) -> Iterator[str]:
    """The lines about the offers, the best offer first."""
    if not answer["offers"]:
        return
    quote_id = answer["quote_id"]
    yield f"quote {quote_id}, fleet time {_moment(answer['made_at'])}"
    for place in answer["places"]:
        yield f"{', '.join(place['fields'])}: {_walks(place)}"
    for number, offer in enumerate(answer["offers"], start=1):
        provider_id = offer["provider_id"]
        yield (
            f"{number}. {price_in_words(offer['price'])}, "
            f"{names.get(provider_id, provider_id)} ({provider_id})"
        )
        if offer.get("pooled_price") is not None:
            yield f"   pooled   {price_in_words(offer['pooled_price'])} if the trip is shared"
        yield f"   pickup   {_moment(offer['pickup_at'])} at {offer['pickup_station_id']}"
        for package in offer["packages"]:
            package_id = package["package_id"]
            p90_at = package.get("eta_p90_at")
            by = f", nine of ten by {_moment(p90_at)}" if p90_at else ""
            place = package["destination_station_id"]
            yield f"   arrival  {_moment(package['eta_at'])}  {package_id} at {place}{by}"
        yield from _margin(offer["margins"].get("risk"))
        kept = "its drones and pads are held until then" if offer["is_held"] else "nothing is held"
        yield f"   expires  {_moment(offer['expires_wall_at'])} wall time; {kept}"
        yield f"   accept   skyway accept {quote_id} {offer['offer_id']}"


def _walks(place: dict[str, Any]) -> str:
    """How far the stations near a place are, the nearest first."""
    stations = (place["served_by"], *place["alternatives"])
    return ", ".join(f"{each['walk_m']:.0f} m to {each['station_id']}" for each in stations)


def _margin(risk: dict[str, Any] | None) -> Iterator[str]:
    """The line about an energy margin that follows from a risk; none if it is a constant."""
    if risk is None:
        return
    way = "" if risk["from"] is None else f" on the flight from {risk['from']} to {risk['to']}"
    share = f"{100 * risk['reserve_risk']:.2g} % of landings"
    is_most = risk["limited_by"] == "MOST"
    kept = (
        f"the largest margin, but more than {share} may be" if is_most else f"at most {share} are"
    )
    more = f"{100 * risk['flight_margin']:.0f} % more energy{way}"
    yield f"   margin   {more}: {kept} below the reserve"


def _reasons(answer: dict[str, Any], names: dict[str, str]) -> Iterator[str]:
    """The lines about the providers that offer nothing."""
    for reason in answer["infeasible"]:
        name = names.get(reason["provider_id"], reason["provider_id"])
        who = f"{name}: " if name else ""
        yield f"no offer: {who}{reason['code']}, {reason['detail']}"


def _moment(text: str) -> str:
    """A moment of the gateway, in UTC to the second."""
    return datetime.fromisoformat(text).astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
