"""Thinning on board: which samples say something that the cloud cannot tell from the last one."""

from datetime import datetime, timedelta
from math import cos, hypot, radians
from typing import Final

from skyway.geo import EARTH_RADIUS_M, Position
from skyway_drone_agent.analysis.analysis import Assessment
from skyway_drone_agent.analysis.wind_triangle import Velocity

#: A sample goes out at least every so many seconds of wall time.
_SILENT_AT_MOST: Final = timedelta(seconds=10)

#: Metres between where the drone is and where the last sample's velocity has taken it.
_POSITION_M: Final = 25.0

#: Change of the charge, as a part of the whole.
_SOC: Final = 0.005

#: Change of the power, as a share of the last sample's, and W within which it is all the same.
_POWER, _POWER_W = 0.05, 1.0

#: Change of the speed over ground.
_SPEED_MPS: Final = 0.5

#: Change of the battery's temperature.
_TEMPERATURE_K: Final = 1.0


class TelemetryThinning:
    """Compares with what was sent last."""

    __slots__ = ("_sent", "_sent_wall_at")

    def __init__(self) -> None:
        self._sent: Assessment | None = None
        self._sent_wall_at: datetime | None = None

    def is_news(self, assessment: Assessment, *, wall_at: datetime) -> bool:
        """Whether this is to be sent: something is beyond its dead band, or it was silent long."""
        sent, sent_wall_at = self._sent, self._sent_wall_at
        if sent is None or sent_wall_at is None or wall_at - sent_wall_at >= _SILENT_AT_MOST:
            return True
        return (
            abs(assessment.soc - sent.soc) > _SOC
            or abs(assessment.power_w - sent.power_w) > max(_POWER * abs(sent.power_w), _POWER_W)
            or abs(assessment.speed_mps - sent.speed_mps) > _SPEED_MPS
            or abs(assessment.temperature_c - sent.temperature_c) > _TEMPERATURE_K
            or _strayed_m(sent, assessment) > _POSITION_M
        )

    def sent(self, assessment: Assessment, *, wall_at: datetime) -> None:
        """Compare with this one from now on."""
        self._sent, self._sent_wall_at = assessment, wall_at


def _strayed_m(sent: Assessment, now: Assessment) -> float:
    """Distance from straight on; on a flat map, which a few kilometres allow."""
    east, north = _metres_between(sent.position, now.position)
    flown: Velocity = sent.velocity_mps
    seconds = (now.at - sent.at).total_seconds()
    return hypot(east - flown[0] * seconds, north - flown[1] * seconds)


def _metres_between(start: Position, end: Position) -> tuple[float, float]:
    narrowing = cos(radians(start.latitude_deg))
    east_deg = end.longitude_deg - start.longitude_deg
    north_deg = end.latitude_deg - start.latitude_deg
    metre = radians(EARTH_RADIUS_M)
    return east_deg * narrowing * metre, north_deg * metre
