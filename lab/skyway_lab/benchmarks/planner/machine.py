"""The machine on which the numbers were measured."""

import os
import platform
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Self


@dataclass(frozen=True, slots=True)
class Machine:
    """Processor, memory, and the versions that matter for speed; `load` is the mean of 1 min."""

    processor: str
    cores: int
    memory_gib: float
    system: str
    python: str
    numpy: str
    numba: str
    load: float

    @classmethod
    def here(cls) -> Self:
        """The machine that runs this, now."""
        pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        return cls(
            processor=_processor(),
            cores=os.cpu_count() or 1,
            memory_gib=round(pages / 2**30, 1),
            system=f"{platform.system()} {platform.machine()}",
            python=platform.python_version(),
            numpy=installed("numpy") or "none",
            numba=installed("numba") or "none",
            load=round(os.getloadavg()[0], 2),
        )

    def as_text(self) -> str:
        """One line."""
        return (
            f"{self.processor}, {self.cores} cores, {self.memory_gib:g} GiB, {self.system}, "
            f"Python {self.python}, numpy {self.numpy}, numba {self.numba}, load {self.load:g}"
        )


def installed(distribution: str) -> str | None:
    """The version of a distribution, None if it is not installed."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if not info.exists():
        return platform.processor()
    names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
    return names[0].split(":", 1)[1].strip() if names else platform.machine()
