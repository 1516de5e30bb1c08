"""The gauge that shows which parts of a service are ready."""

from skyway.runtime.gauges import Gauge, GaugeSource
from skyway.runtime.http.app import Readiness


def readiness_gauges(readiness: Readiness) -> GaugeSource:
    """`skyway_part_ready`: 1 for each part that GET /readyz finds, and 0 for a missing part."""

    async def read() -> list[Gauge]:
        about = "whether a part that the service needs is there"
        return [
            Gauge("skyway_part_ready", about, float(is_there), {"part": part})
            for part, is_there in (await readiness()).items()
        ]

    return GaugeSource("parts", read)
