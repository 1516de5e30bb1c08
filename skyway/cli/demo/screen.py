"""The demo's output: a timeline, and one live line about the drone in flight."""

from datetime import datetime
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from skyway.cli.delivery import proof_of
from skyway.cli.demo.flown import HANDLING_STEPS, Flown
from skyway.cli.demo.webhook_receiver import Notification
from skyway.cli.quote import price_in_words
from skyway.contracts.drone_report import DroneState

_BATTERY_CELLS = 20


class DemoScreen:
    """Prints live to a terminal, and as plain lines to a file or pipe."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, auto_refresh=False, transient=True)
        self._last_progress = ""
        self._provider_names: dict[str, str] = {}

    def __enter__(self) -> "DemoScreen":
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def starting(self, *, planned_s: float, rate: float) -> None:
        """Print how fast the fleet clock runs, and why."""
        self._console.rule("[bold]Skyway: San Marcos to McQueeney, Bulverde and San Antonio")
        self._console.print(
            f"Rehearsed: about {_duration(planned_s)} of flying and recharging; the fleet clock "
            f"runs {rate:,.0f} times faster than the wall clock.\nStarting registry, broker, "
            "composition, gateway ..."
        )

    def watch_at(self, link: str) -> None:
        """Print where to watch the system; the line is not wrapped, because people copy it."""
        self._console.print(f"Watch it: {link} (works once)", soft_wrap=True, markup=False)

    def cast(self, provider_names: dict[str, str]) -> None:
        """Print the providers."""
        self._provider_names = provider_names
        *others, last = provider_names.values()
        names = f"{', '.join(others)}, and {last} with one drone"
        self._console.print(f"Registered: {names}. Their drones connect ...")

    def others(self, deliveries: list[dict[str, Any]]) -> None:
        """Print the other customer's deliveries."""
        for delivery in deliveries:
            places = ", ".join(p["destination"]["station_id"] for p in delivery["packages"])
            pickup = delivery["request"]["pickup"]["station_id"]
            flies = f"{delivery['state']}, {self._flies(delivery)}"
            self._console.print(f"[dim]  others: {pickup} to {places}: {flies}[/]")

    def chained(self, delivery: dict[str, Any], *, number: int) -> None:
        """Print the state of a delivery of the provider that has one drone."""
        package = delivery["packages"][0]
        pickup = delivery["request"]["pickup"]["station_id"]
        state, when = delivery["state"], package["delivered_at"] or package["eta_at"]
        if state == "PLANNED" and number > 1:
            state += f" behind {number - 1}"
        self._console.print(
            f"[magenta]  courier {number}: {pickup} to "
            f"{package['destination']['station_id']}: {state}, "
            f"{'arrived' if package['delivered_at'] else 'arrives'} {_clock(when)}[/]",
            highlight=False,
        )

    def request(self, request: dict[str, Any]) -> None:
        """Print the customer's request."""
        self._console.print(
            f"\n[bold]Request[/] QoS {request['qos']['objective'].lower()}, "
            f"pickup {request['pickup']['station_id']}"
        )
        for package in request["packages"]:
            destination = package["destination"]["station_id"]
            line = f"  {package['package_id']:<10} {package['mass_kg']:.1f} kg  to {destination}"
            self._console.print(line)

    def offers(self, quote: dict[str, Any], *, objective: str) -> None:
        """Print the offers, the best by this objective first, and providers without an offer."""
        self._console.print(f"\n[bold]Offers[/] {objective.lower()} first")
        for offer in quote["offers"]:
            self._console.print(
                f"  {self._provider_names.get(offer['provider_id'], offer['provider_id']):<20} "
                f"{price_in_words(offer['price']):>11}  "
                f"{_duration(offer['delivery_time_s']):>8}  {offer['energy_j'] / 3.6e6:.3f} kWh  "
                f"score {offer['score']:.3f}",
                highlight=False,
            )
        for reason in quote["infeasible"]:
            name = self._provider_names.get(reason["provider_id"], reason["provider_id"])
            self._console.print(f"  [dim]{name}: {reason['code']}, {reason['detail']}[/]")

    def plan(self, mission: dict[str, Any]) -> None:
        """Show the provider, the drone and the composed plan."""
        provider = self._provider_names.get(mission["provider_id"], mission["provider_id"])
        self._console.print(
            f"\n[bold]Composed[/] by {provider}, drone {mission['drone_id']}, "
            f"{price_in_words(mission['price'])}, revision {mission['revision']}"
        )
        self._console.print(_plan_table(mission["plan"]))
        self._console.print(f"[bold green]{_proven(mission['plan'])}[/]", highlight=False)

    def progress(self, delivery: dict[str, Any], state: DroneState, *, charge: float) -> None:
        """Show the drone's place, its battery and its activity."""
        line = (
            f"{delivery['state']:<12} {state.activity:<10} "
            f"{'at ' + state.station_id if state.station_id else 'in the air':<22}"
        )
        if self._console.is_terminal:
            self._live.update(Text(f"{line} {_battery(charge)}", style="cyan"), refresh=True)
        elif line != self._last_progress:
            self._console.print(f"  {line} {_battery(charge)}", highlight=False)
        self._last_progress = line

    def notified(self, notification: Notification) -> None:
        """Print a webhook that arrived at the customer."""
        event = notification.event
        what = event["data"].get("package_id", "")
        where = event["data"].get("station_id", "")
        text = f"webhook {event['sequence']:>2}  {_clock(event['occurred_at'])}  {event['type']}"
        style = "bold green" if event["type"] == "package.delivered" else "green"
        signed = "signature ok" if notification.is_signed else "[red]BAD SIGNATURE[/]"
        self._console.print(f"  [{style}]{text}[/] {what} {where} [dim]({signed})[/]")

    def end(self, delivery: dict[str, Any], flown: Flown, *, wall_s: float) -> None:
        """Print when each package was delivered, and compare the plan with the flight."""
        self._live.update(Text())
        self._console.print(f"\n[bold]{delivery['state']}[/] after {wall_s:.0f} s of wall time")
        for package in delivery["packages"]:
            when = _clock(package["delivered_at"]) if package["delivered_at"] else "never"
            self._console.print(
                f"  {package['package_id']:<10} {package['state']} at "
                f"{package['destination']['station_id']}, {when} fleet time"
            )
        self.compare(delivery, flown)

    def compare(self, delivery: dict[str, Any], flown: Flown) -> None:
        """Compare the plan of each mission with the flight."""
        for mission in delivery["missions"]:
            self._console.print(_comparison_table(mission, flown))

    def _flies(self, delivery: dict[str, Any]) -> str:
        for mission in delivery["missions"]:
            provider = self._provider_names.get(mission["provider_id"], mission["provider_id"])
            return f"{provider}, {_duration(mission['plan']['delivery_time_s'])}"
        return "waiting for a drone"


def _proven(plan: dict[str, Any]) -> str:
    return f"{proof_of(plan)} ({_duration(plan['delivery_time_s'])})"


def _plan_table(plan: dict[str, Any]) -> Table:
    table = Table(box=None, header_style="dim", padding=(0, 2))
    for heading in ("from", "to"):
        table.add_column(heading, justify="right")
    for heading in ("step", "where"):
        table.add_column(heading)
    table.add_column("charge after", justify="right")
    for step in plan["steps"]:
        where = f"{step['from']} to {step['to']}" if step["kind"] == "FLY" else step["station_id"]
        if step["kind"] == "RECHARGE":
            where += f", pad {step['pad']}"
        if step.get("package_ids"):
            where += f": {', '.join(step['package_ids'])}"
        charge = f"{step['soc_end']:.0%}" if "soc_end" in step else ""
        times = _duration(step["start_s"]), _duration(step["end_s"])
        table.add_row(*times, step["kind"], where, charge)
    return table


def _comparison_table(mission: dict[str, Any], flown: Flown) -> Table:
    start_at = datetime.fromisoformat(mission["start_at"])
    plan, actual = mission["plan"], flown.of(mission["mission_id"], start_at=start_at)
    handling_s = sum(
        step["end_s"] - step["start_s"] for step in plan["steps"] if step["kind"] in HANDLING_STEPS
    )
    table = Table(title=f"Planned against flown, drone {mission['drone_id']}")
    for heading in ("", "planned", "flown"):
        table.add_column(heading, justify="left" if not heading else "right")
    durations = (
        ("flying", plan["flight_s"], actual.flight_s),
        ("recharging", plan["recharging_s"], actual.recharging_s),
        ("loading and handing over", handling_s, actual.handling_s),
        ("waiting", plan["waiting_s"], actual.waiting_s),
        ("delivery time", plan["delivery_time_s"], actual.delivery_time_s),
    )
    for name, planned_s, flown_s in durations:
        table.add_row(name, _duration(planned_s), _duration(flown_s))
    energy = (f"{joules / 3.6e6:.3f} kWh" for joules in (plan["energy_j"], actual.energy_j))
    table.add_row("energy", *energy)
    return table


def _battery(soc: float) -> str:
    full = round(soc * _BATTERY_CELLS)
    return f"{'█' * full}{'░' * (_BATTERY_CELLS - full)} {soc:4.0%}"


def _duration(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 3600}:{whole % 3600 // 60:02}:{whole % 60:02}"


def _clock(moment: str) -> str:
    return datetime.fromisoformat(moment).strftime("%H:%M:%S")
