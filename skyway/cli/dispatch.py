"""`skyway dispatch`: reads a fleet problem, and prints the plan of its whole fleet.

Only this command imports the dispatcher, because the import takes time.
"""

import os
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from skyway.cli.compose import NotJson, documents
from skyway.cli.data_folder import data_folder, keep_kernels
from skyway.errors import InvalidInput
from skyway.workers import RAY_ADDRESS, open_workers

if TYPE_CHECKING:
    from skyway.dispatch.plan import FleetCosts, FleetPlan, FleetTrip

#: The exit code if the problem cannot be read.
_UNREADABLE = 2

#: The Ray cluster that runs the heavy work, for this command and for `skyway experiment`.
RayAddress = Annotated[
    str | None,
    typer.Option(
        envvar=RAY_ADDRESS,
        show_envvar=True,
        help="A Ray cluster that does the work (auto, host:port) instead of processes of this "
        "machine; needs skyway[ray].",
    ),
]


def dispatch_command(
    file: Annotated[
        typer.FileBinaryRead, typer.Argument(help="A fleet problem; - is standard input.")
    ],
    budget: Annotated[
        float, typer.Option(min=0.0, help="Seconds of processor time for the search.")
    ] = 10.0,
    rounds: Annotated[
        int | None,
        typer.Option(min=0, help="Rounds of the search instead of a budget; repeatable."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search's random numbers.")] = 0,
    bound: Annotated[
        bool, typer.Option("--bound", help="Prove a lower bound on the objective of every plan.")
    ] = False,
    searches: Annotated[
        int,
        typer.Option(min=1, help="Searches in parallel; the best plan counts."),
    ] = 1,
    json: Annotated[bool, typer.Option("--json", help="Print the plan as JSON.")] = False,
    ray_address: RayAddress = None,
) -> None:
    """Plan all open requests of a fleet together."""
    keep_kernels(data_folder())
    from skyway.dispatch import optimise, read_fleet_problem
    from skyway.dispatch.warm import warm

    document = next(documents(file))
    if isinstance(document, NotJson):
        typer.echo(f"line {document.line}: {document.detail}", err=True)
        raise typer.Exit(_UNREADABLE)
    try:
        problem = read_fleet_problem(document.value)
    except InvalidInput as error:
        for fault in error.faults:
            typer.echo(f"line {document.line}: {fault}", err=True)
        raise typer.Exit(_UNREADABLE) from error
    find = partial(optimise, problem, budget_s=budget, rounds=rounds, seed=seed, proves=bound)
    if searches == 1:
        plan = find()
    else:
        count = min(searches, os.cpu_count() or 1)
        with open_workers(count, warm_up=warm, ray_address=ray_address) as executor:
            plan = find(searches=searches, executor=executor)
    if json:
        typer.echo(plan.model_dump_json())
        return
    for line in plan_text(plan):
        typer.echo(line)


def plan_text(plan: "FleetPlan") -> Iterator[str]:
    """The plan in lines for people: what it costs, then the trips of each drone."""
    yield _costs_text("plan", plan.costs)
    yield _costs_text("arrival order", plan.arrival_order)
    if plan.is_best_order:
        yield "proven: no other order in which the trips are planned costs less"
    if plan.lower_bound_s is not None:
        yield f"proven: no plan has an objective below {plan.lower_bound_s:.0f} s"
        yield f"        at most {plan.gap:.0%} of the objective can be saved"
    drone_id = None
    for trip in plan.trips:
        if trip.drone_id != drone_id:
            drone_id = trip.drone_id
            yield f"{drone_id}"
        yield f"  {_trip_text(trip)}"
    for each in plan.unserved:
        yield f"not served: {each.request_id}: {each.code}: {each.detail}"


def _costs_text(name: str, costs: "FleetCosts") -> str:
    mean = "-" if costs.mean_delivery_s is None else f"{costs.mean_delivery_s / 60:.1f} min"
    return (
        f"{name + ':':15}{costs.served} served, mean {mean}, late {costs.lateness_s / 60:.0f} min, "
        f"{costs.energy_j / 3.6e6:.1f} kWh, objective {costs.total_s:.0f} s"
    )


def _trip_text(trip: "FleetTrip") -> str:
    served = ", ".join(
        f"{one.request_id} at {one.delivered_s / 60:.1f} min"
        for one in sorted(trip.requests, key=lambda one: one.delivered_s)
    )
    charged_min = (trip.plan.recharging_s or 0.0) / 60
    return f"from {trip.start_s / 60:.1f} min: {served} (charges {charged_min:.0f} min)"
