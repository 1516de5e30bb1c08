"""What a hostile run is asked to do."""

import argparse
from dataclasses import dataclass

from skyway_lab.benchmarks.chaos.trial import Trial as ChaosTrial
from skyway_lab.benchmarks.load.burst import Storage


@dataclass(frozen=True, slots=True)
class Trial:
    """One run; both phases take half of it each, minutes of wall time."""

    storage: Storage
    minutes: float
    seed: int
    drones: int
    stations: int
    rate_per_s: float
    clock_rate: float
    #: How many times slower the attack may make what honest people do, by the median.
    most_times: float
    #: One part of it alone, with tables and no judgement; empty for the whole run.
    only: str = ""

    @property
    def phase_s(self) -> float:
        """How long it is calm, and then how long the rogues attack, wall seconds."""
        return 60.0 * self.minutes / 2

    def as_chaos(self) -> ChaosTrial:
        """The same as the chaos benchmark calls it, which builds the system and its people."""
        return ChaosTrial(
            storage=self.storage,
            minutes=self.minutes,
            seed=self.seed,
            stations=self.stations,
            drones=self.drones,
            providers=2,
            rate_per_s=self.rate_per_s,
            clock_rate=self.clock_rate,
            agents=1,
            quiet_s=150.0,
            only=(),
            without=(),
            write=False,
        )

    def as_text(self) -> str:
        """One line."""
        return (
            f"{self.storage} pair, {self.stations} stations, {self.drones} drones; honest "
            f"customers request {self.rate_per_s:g} deliveries/s; calm for {self.phase_s:g} s, "
            f"attacked for {self.phase_s:g} s; clock rate {self.clock_rate:g}, seed {self.seed}"
        )


def read_trial(arguments: list[str]) -> Trial:
    """The run that the arguments ask for."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab hostile", description=__doc__)
    parser.add_argument("--storage", choices=("embedded", "production"), default="embedded")
    parser.add_argument("--minutes", type=float, default=6.0, help="both phases together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drones", type=int, default=20)
    parser.add_argument("--stations", type=int, default=20)
    parser.add_argument("--rate-per-s", type=float, default=0.5, help="honest requests")
    parser.add_argument("--clock-rate", type=float, default=600.0)
    parser.add_argument(
        "--most-times", type=float, default=2.0, help="slower, by the median, is a flaw"
    )
    parser.add_argument(
        "--only",
        choices=("bodies", "budgets"),
        default="",
        help="bodies: what each refusal costs; budgets: honest callers beside the dearest calls",
    )
    return Trial(**vars(parser.parse_args(arguments)))
