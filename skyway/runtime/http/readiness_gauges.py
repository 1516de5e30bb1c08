"""The gauge that says which parts of a service are there."""

from skyway.runtime.gauges import Gauge, GaugeSource
from skyway.runtime.http.app import Readiness


def readiness_gauges(readiness: Readiness) -> GaugeSource:
    """`skyway_part_ready`: 1 for each part that is there, as GET /readyz says, and 0 otherwise."""

    async def read() -> list[Gauge]:
        about = "whether a part that the service needs is there"
        return [
            Gauge("skyway_part_ready", about, float(is_there), {"part": part})
            for part, is_there in (await readiness()).items()
        ]

    return GaugeSource("parts", read)
