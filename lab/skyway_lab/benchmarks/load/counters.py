"""What the services count of themselves: the sums of their own counters at /metrics."""

from collections.abc import Mapping
from typing import Final

import httpx

_OURS: Final = "skyway_"
#: The end of a counter's name. Gauges and histograms cannot be added up by their names alone.
_GROWS: Final = "_total"


async def counters(urls: Mapping[str, str], *, metrics_key: str) -> dict[str, float]:
    """Each counter of ours by name, added up over services and labels."""
    sums: dict[str, float] = {}
    headers = {"Authorization": f"Bearer {metrics_key}"}
    async with httpx.AsyncClient(timeout=10.0, headers=headers) as client:
        for url in urls.values():
            text = (await client.get(f"{url}/metrics")).text
            for name, value in _values(text):
                sums[name] = sums.get(name, 0.0) + value
    return sums


def _values(text: str) -> list[tuple[str, float]]:
    """Lines like ``name_total{label="x"} 3.0``."""
    found = []
    for line in text.splitlines():
        if line.startswith(_OURS):
            series, _, value = line.rpartition(" ")
            name = series.partition("{")[0]
            if name.endswith(_GROWS):
                found.append((name, float(value)))
    return found
