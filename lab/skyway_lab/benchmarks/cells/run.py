"""One run: regions on one composition, or each region on a cell of its own."""

from dataclasses import dataclass
from typing import Final

from skyway_lab.benchmarks.cells.regions import Regions
from skyway_lab.benchmarks.load.burst import Burst
from skyway_lab.benchmarks.load.figures import Outcome
from skyway_lab.benchmarks.load.run import data_folder, measured, pids_of, verify
from skyway_lab.benchmarks.load.storage_pair import storage_pair
from skyway_lab.benchmarks.load.world import populate

from skyway.cli.gateway import GatewayApi, read_keys
from skyway.cli.system.children import Ports
from skyway.cli.system.running_system import running_system
from skyway.contracts.delivery_event import DeliveryEventType

#: The services whose time may depend on cells, with their databases.
SERVICES: Final = ("gateway", "composition", "registry")


@dataclass(frozen=True, slots=True)
class Cost:
    """Milliseconds of processor time for each dispatch, by service with its database."""

    cells: int
    dispatched: int
    each_ms: dict[str, float]
    #: Cores that the services take while no request is sent.
    idle_cores: float
    violations: str

    @property
    def all_ms(self) -> float:
        """Gateway, composition and registry together."""
        return sum(self.each_ms.values())


async def run(burst: Burst, *, regions: int, cells: int) -> Cost:
    """The cost of this burst with so many cells; without cells, one composition serves all."""
    with data_folder() as folder, storage_pair(burst.storage, folder) as servers:
        places = Regions.of(regions, stations=burst.stations, seed=burst.seed)
        async with running_system(
            folder,
            rate=burst.clock_rate,
            ports=Ports(gateway=0, broker=0),
            say=print,
            cells=list(places.cities)[:cells],
        ) as system:
            key = read_keys(folder)["SKYWAY_OPERATOR_KEY"]
            async with GatewayApi(system.urls["gateway"]) as api:
                world = await populate(system, api, places, operator_key=key, burst=burst)
            pids = pids_of(system, world)
            for name in system.cells:
                if (pid := system.supervisor.pid(name)) is not None:
                    pids[f"composition-{name}"] = pid
            pids |= {name: one.pid for name, one in servers.items()}
            outcome = await measured(system, world, places, burst=burst, pids=pids, check=verify)
    return _cost(outcome, cells=cells)


def _cost(outcome: Outcome, *, cells: int) -> Cost:
    """The processor time that the requests have added to what the services take idle."""
    dispatched = len(outcome.followed.of(DeliveryEventType.DISPATCHED))
    usage = outcome.usage
    busy_s, idle_s = (
        {name: each.get(name, 0.0) + each.get(f"postgresql {name}", 0.0) for name in SERVICES}
        for each in (usage.busy.seconds, usage.idle.seconds)
    )
    each_ms = {
        name: 1e3 * (busy_s[name] - idle_s[name] * usage.busy_s / usage.idle_s) / max(1, dispatched)
        for name in SERVICES
    }
    idle_cores = sum(idle_s.values()) / usage.idle_s
    return Cost(cells, dispatched, each_ms, idle_cores, outcome.violations)
