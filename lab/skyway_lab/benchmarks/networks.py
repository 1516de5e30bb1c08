"""How long a network takes to build, write, read and prepare, by its number of stations.

Synthetic cities of degree about 6; seed 1. Prints seconds of wall and processor time for each step
and the highest memory of the process up to its end; a process of its own for each size. A million
stations take minutes: `python benchmarks/networks.py --million`.
"""

import argparse
import json
import platform
import random
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from skyway.geo import Position
from skyway.ids import ZoneId
from skyway.network.geojson import read_network, write_network
from skyway.network.geojson_text import network_text, read_network_text
from skyway.network.network import Network, Zone
from skyway.network.nx import from_networkx, to_networkx
from skyway.network.synthetic import synthetic_city
from skyway.planner.airspace import Airspace

SEED = 1
ZONES = 50
STATIONS = (10_000, 100_000)
MILLION = 1_000_000

#: Whole documents and graphs of a million stations fill the memory of a small machine.
MOST_AS_OBJECTS = 100_000


def main(arguments: list[str]) -> None:
    """Print the table, or the rows of one size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--million", action="store_true", help="a million stations, too")
    parser.add_argument("--stations", type=int, help="this size only, in this process")
    chosen = parser.parse_args(arguments)
    if chosen.stations is not None:
        measure(chosen.stations)
        return
    machine = f"Python {platform.python_version()}, {platform.machine()}"
    print(f"seed {SEED}, {machine}")
    print(f"{'stations':>9}  {'step':24}{'wall s':>8}{'cpu s':>8}{'peak MiB':>10}", flush=True)
    for stations in (*STATIONS, *((MILLION,) if chosen.million else ())):
        subprocess.run([sys.executable, __file__, "--stations", str(stations)], check=True)


def measure(stations: int) -> None:
    """Take a network of this size through everything."""
    with step(stations, "build"):
        network = synthetic_city(stations=stations, seed=SEED)
    with step(stations, "write text"):
        text = network_text(network)
    with step(stations, "read text"):
        network = read_network_text(text)
    del text
    with step(stations, "prepare adjacency"):
        _ = network.outgoing, network.incoming
    zoned = Network.from_columns(network.columns, zones_over(network))
    with step(stations, f"prepare {ZONES} zones"):
        Airspace.of(zoned)
    if stations > MOST_AS_OBJECTS:
        return
    with step(stations, "write document"):
        document = write_network(network)
    document = json.loads(json.dumps(document))
    with step(stations, "read document"):
        read_network(document)
    del document
    with step(stations, "to NetworkX"):
        graph = to_networkx(network)
    with step(stations, "from NetworkX"):
        from_networkx(graph)


@contextmanager
def step(stations: int, name: str) -> Iterator[None]:
    """Measure what happens within, and print it as a row."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    yield
    wall_s, cpu_s = time.perf_counter() - wall_s, time.process_time() - cpu_s
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{stations:>9,}  {name:24}{wall_s:8.2f}{cpu_s:8.2f}{peak_mib:10,.0f}", flush=True)


def zones_over(network: Network) -> list[Zone]:
    """Squares of 2 km, or of 20 km, anywhere in the city."""
    chance = random.Random(SEED)
    ids = network.columns.station_ids
    zones = []
    for number in range(ZONES):
        west, south = network.stations[chance.choice(ids)].position
        east, north = (edge + chance.choice((0.02, 0.2)) for edge in (west, south))
        corners = ((west, south), (east, south), (east, north), (west, north), (west, south))
        ring = tuple(Position(*corner) for corner in corners)
        zones.append(Zone(ZoneId(f"z{number}"), (ring,)))
    return zones


if __name__ == "__main__":
    main(sys.argv[1:])
