"""The processor time that processes have taken, as Linux counts it."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

#: The service of each database; those of cells are databases of composition.
_DATABASES: Final = {
    "gateway": "gateway",
    "composition": "composition",
    "cell": "composition",
    "registry": "registry",
}

_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class CpuReading:
    """Seconds of processor time by name; `machine_s` is all that anybody took, ourselves too."""

    seconds: Mapping[str, float]
    machine_s: float

    @classmethod
    def of(cls, pids: Mapping[str, int]) -> Self:
        """What these processes and those below them have taken; databases count by service.

        Replicas count together: `composition-2` is another process of composition.
        """
        seconds: dict[str, float] = {}
        for name, pid in pids.items():
            for one in with_descendants([pid]):
                own = name.partition("-")[0]
                label = _postgresql_part(one) if own == "postgresql" else own
                seconds[label] = seconds.get(label, 0.0) + _taken_s(one)
        return cls(seconds, _machine_s())

    def since(self, earlier: Self) -> "CpuReading":
        """What was taken between two readings; a process that was not there had taken nothing."""
        seconds = {
            name: max(0.0, taken - earlier.seconds.get(name, 0.0))
            for name, taken in self.seconds.items()
        }
        return CpuReading(seconds, self.machine_s - earlier.machine_s)


def with_descendants(pids: Iterable[int]) -> Iterable[int]:
    """These processes, and all that they have started."""
    for pid in pids:
        yield pid
        try:
            children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        except OSError:
            continue
        yield from with_descendants(int(child) for child in children)


def _taken_s(pid: int) -> float:
    """User and system time of all threads (proc(5): fields 14 and 15); 0 once it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def _postgresql_part(pid: int) -> str:
    """``postgresql gateway`` for a connection of the gateway, ``postgresql`` for the rest."""
    try:
        title = Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return "postgresql"
    for database, service in _DATABASES.items():
        if f"skyway_{database}" in title:
            return f"postgresql {service}"
    return "postgresql"


def _machine_s() -> float:
    """All processors' time that was not idle: user, nice, system, irq, softirq."""
    first = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    user, nice, system, _idle, _iowait, irq, softirq = map(int, first[:7])
    return (user + nice + system + irq + softirq) / _TICKS_PER_S
