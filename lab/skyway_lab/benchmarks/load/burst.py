"""What is asked of the system: the city, the stream of requests, the pair of storage."""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from skyway.contracts.delivery_event import DeliveryEventType

Storage = Literal["embedded", "production"]


@dataclass(frozen=True, slots=True)
class Burst:
    """One run; times are wall seconds, `clock_rate` is fleet seconds per wall second.

    At clock rate 1, as in production, a drone sends telemetry as often as a real one does.
    """

    storage: Storage
    stations: int
    drones: int
    providers: int
    rate_per_s: float
    seconds: float
    clock_rate: float
    #: Number of processes that host the drones.
    agents: int
    #: How long the run waits after the last request until all are dispatched or rejected.
    longest_wait_s: float
    seed: int
    #: How many processes of gateway, composition and registry each.
    replicas: int = 1
    #: Whether the processor time of whole flights is measured, until every delivery has ended.
    is_flown: bool = False
    #: Folder for the stacks of every process (py-spy) and for PostgreSQL's statements.
    profile: Path | None = None

    @property
    def counted_event(self) -> DeliveryEventType:
        """The event of a delivery at which its cost is complete."""
        return DeliveryEventType.COMPLETED if self.is_flown else DeliveryEventType.DISPATCHED

    def as_text(self) -> str:
        """One line."""
        return (
            f"{self.storage} pair, {self.replicas} processes of each service, "
            f"{self.stations:,} stations, {self.drones:,} drones in "
            f"{self.agents} processes, {self.providers} providers; {self.rate_per_s:g} requests/s "
            f"for {self.seconds:g} s; clock rate {self.clock_rate:g}, seed {self.seed}"
        )


def read_burst(arguments: list[str]) -> Burst:
    """The run that the arguments ask for."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab load", description=__doc__)
    parser.add_argument("--storage", choices=("embedded", "production"), default="embedded")
    parser.add_argument("--stations", type=int, default=1_000)
    parser.add_argument("--drones", type=int, default=2_000)
    parser.add_argument("--providers", type=int, default=20)
    parser.add_argument("--rate-per-s", type=float, default=10.0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--clock-rate", type=float, default=1.0)
    parser.add_argument("--agents", type=int, default=2, help="processes that host the drones")
    parser.add_argument("--longest-wait-s", type=float, default=30.0, help="after the last request")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--replicas", type=int, default=1, help="processes of each service")
    parser.add_argument(
        "--flown",
        dest="is_flown",
        action="store_true",
        help="measure until every delivery has ended: needs a fast --clock-rate and a long wait",
    )
    parser.add_argument("--profile", type=Path, metavar="FOLDER", help="stacks, statements")
    burst = Burst(**vars(parser.parse_args(arguments)))
    if burst.replicas > 1 and burst.storage == "embedded":
        parser.error("the embedded pair has one process of each service: add --storage production")
    return burst
