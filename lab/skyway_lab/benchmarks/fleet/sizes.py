"""Which parts of the fleet are measured, with how many drones, and for how long."""

import argparse
from dataclasses import dataclass
from typing import Final

PARTS: Final = ("hosting", "feeding", "embedded")


@dataclass(frozen=True, slots=True)
class Sizes:
    """Sizes of the parts; each window of measuring lasts `seconds` of wall time."""

    only: tuple[str, ...]
    hosted: int
    fed: int
    flying: int
    agents: int
    viewers: int
    scenario: str
    seconds: float
    step_seconds: float
    seed: int


def read_sizes(arguments: list[str]) -> Sizes:
    """The sizes that the arguments ask for."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab fleet", description=__doc__)
    parser.add_argument(
        "--only", action="append", choices=PARTS, help="this part; may be given several times"
    )
    parser.add_argument("--hosted", type=int, default=1_000, help="drones in one process")
    parser.add_argument("--fed", type=int, default=5_000, help="drones on a whole system")
    parser.add_argument("--flying", type=int, default=2_000, help="how many of these drones fly")
    parser.add_argument("--agents", type=int, default=4, help="processes that host them")
    parser.add_argument("--viewers", type=int, default=0, help="of the live picture meanwhile")
    parser.add_argument("--scenario", default="windy", help="of the drones in one process")
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--step-seconds", type=float, default=5.0, help="at each embedded rate")
    parser.add_argument("--seed", type=int, default=1)
    given = vars(parser.parse_args(arguments))
    return Sizes(**(given | {"only": tuple(given["only"] or PARTS)}))
