"""What is asked of the benchmark: sizes of each kind, and the load that measures them."""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from skyway_lab.benchmarks.load.burst import Burst, Storage


@dataclass(frozen=True, slots=True)
class Size:
    """How much there is besides what the load needs."""

    deliveries: int
    drones: int
    stations: int

    @property
    def name(self) -> str:
        """The name of its folder."""
        return f"{self.deliveries}-{self.drones}-{self.stations}"

    def as_text(self) -> str:
        """The size in words."""
        return (
            f"{self.deliveries:,} past deliveries, {self.drones:,} more drones, "
            f"{self.stations:,} stations"
        )


@dataclass(frozen=True, slots=True)
class Growth:
    """All runs: the smallest size, and each kind grown alone."""

    deliveries: tuple[int, ...]
    drones: tuple[int, ...]
    stations: tuple[int, ...]
    load: Burst

    @property
    def smallest(self) -> Size:
        """The first size of each kind."""
        return Size(self.deliveries[0], self.drones[0], self.stations[0])

    def grown(self) -> Iterator[tuple[str, Size]]:
        """Each further size, with the kind that has grown."""
        for kind in ("deliveries", "drones", "stations"):
            for count in getattr(self, kind)[1:]:
                yield kind, replace(self.smallest, **{kind: count})


def read_growth(arguments: list[str]) -> Growth:
    """The runs that the arguments ask for."""
    parser = argparse.ArgumentParser(prog="python -m skyway_lab growth", description=__doc__)
    storages: tuple[Storage, ...] = ("embedded", "production")
    parser.add_argument("--storage", choices=storages, default="embedded")
    parser.add_argument("--deliveries", type=_sizes, default=(1_000, 10_000, 100_000))
    parser.add_argument("--drones", type=_sizes, default=(100,), help="that do not fly")
    parser.add_argument("--stations", type=_sizes, default=(1_000,))
    parser.add_argument("--flying", type=int, default=300, help="drones that fly")
    parser.add_argument("--rate-per-s", type=float, default=5.0)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--profile", type=Path, metavar="FOLDER", help="stacks, statements")
    given = parser.parse_args(arguments)
    load = Burst(
        storage=given.storage,
        stations=given.stations[0],
        drones=given.flying,
        providers=5,
        rate_per_s=given.rate_per_s,
        seconds=given.seconds,
        clock_rate=1.0,
        agents=1,
        longest_wait_s=30.0,
        seed=given.seed,
        profile=given.profile,
    )
    return Growth(given.deliveries, given.drones, given.stations, load)


def _sizes(text: str) -> tuple[int, ...]:
    return tuple(int(float(each)) for each in text.split(","))
