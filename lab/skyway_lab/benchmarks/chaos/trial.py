"""What a run is asked to do: the pair of storage, how long, which seed, how fast the clock runs."""

import argparse
from dataclasses import dataclass

from skyway_lab.benchmarks.load.burst import Burst, Storage

#: Wall seconds after the last fault within which every delivery must end. The longest wait inside
#: Skyway is 120 s for a silent drone; a webhook that failed three times waits 155 s.
_QUIET_S = 300.0


@dataclass(frozen=True, slots=True)
class Trial:
    """One run; seconds are of wall time, `clock_rate` is fleet seconds per wall second."""

    storage: Storage
    #: How long faults come.
    minutes: float
    seed: int
    stations: int
    drones: int
    providers: int
    rate_per_s: float
    clock_rate: float
    #: Processes that host the drones between them.
    agents: int
    quiet_s: float
    #: Faults by their names or kinds; all when it is empty.
    only: tuple[str, ...]
    #: Faults that are left out, by their names or kinds.
    without: tuple[str, ...]
    #: Whether the figures are written into the reference.
    write: bool

    @property
    def seconds(self) -> float:
        """How long faults come, wall seconds."""
        return 60.0 * self.minutes

    @property
    def replicas(self) -> int:
        """How many processes gateway and composition have each; SQLite serves one."""
        return 2 if self.storage == "production" else 1

    def as_burst(self) -> Burst:
        """The same as the load benchmark calls it, which populates the city."""
        return Burst(
            storage=self.storage,
            stations=self.stations,
            drones=self.drones,
            providers=self.providers,
            rate_per_s=self.rate_per_s,
            seconds=self.seconds,
            clock_rate=self.clock_rate,
            agents=self.agents,
            longest_wait_s=self.quiet_s,
            seed=self.seed,
        )

    def as_text(self) -> str:
        """One line."""
        return (
            f"{self.storage} pair, {self.replicas} of gateway and composition each, "
            f"{self.stations} stations, {self.drones} drones in {self.agents} processes; "
            f"{self.rate_per_s:g} requests/s and faults for {self.seconds:g} s; "
            f"clock rate {self.clock_rate:g}, seed {self.seed}"
        )


def read_trial(arguments: list[str]) -> Trial:
    """The run that the arguments ask for."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab chaos", description=__doc__)
    parser.add_argument("--storage", choices=("embedded", "production"), default="embedded")
    parser.add_argument("--minutes", type=float, default=10.0, help="how long faults come")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stations", type=int, default=40)
    parser.add_argument("--drones", type=int, default=30)
    parser.add_argument("--providers", type=int, default=4)
    parser.add_argument("--rate-per-s", type=float, default=0.7, help="requests")
    parser.add_argument("--clock-rate", type=float, default=600.0)
    parser.add_argument("--agents", type=int, default=2, help="processes that host the drones")
    parser.add_argument(
        "--quiet-s", type=float, default=_QUIET_S, help="longest wait for all deliveries to end"
    )
    parser.add_argument(
        "--without", action="append", default=[], metavar="FAULT", help="leave out; repeat it"
    )
    parser.add_argument(
        "--only", action="append", default=[], metavar="FAULT", help="a name or kind; repeat it"
    )
    parser.add_argument("--write", action="store_true", help="put the figures into docs/reference")
    read = vars(parser.parse_args(arguments))
    return Trial(**(read | {name: tuple(read[name]) for name in ("only", "without")}))
