"""Telemetry: samples while the drone moves or charges.

The drone leaves out samples that the cloud can compute from the last sample.
"""

import asyncio
from datetime import datetime, timedelta
from typing import Final, Never

from skyway.contracts.drone_report import Telemetry
from skyway.contracts.topics import TELEMETRY
from skyway.geo import distance_m, moved
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.errors import MqttUnavailable
from skyway_drone_agent.analysis.analysis import Assessment
from skyway_drone_agent.failsafes.failsafe import Situation
from skyway_drone_agent.link.uplink import Envelope, Uplink

#: A sample is sent at least once in this wall time.
_SILENT_AT_MOST: Final = timedelta(seconds=10)

#: Metres between the position and the position that the last sample's velocity predicts.
_POSITION_M: Final = 25.0

#: Change of the state of charge.
_SOC: Final = 0.005

#: Change of the power, as a share of the last sample's power, and in watts; the larger counts.
_POWER, _POWER_W = 0.05, 1.0

#: Change of the speed over ground.
_SPEED_MPS: Final = 0.5

#: Change of the battery's temperature.
_TEMPERATURE_K: Final = 1.0


class TelemetryThinning:
    """Decides whether a sample says something new, compared with the last sent one."""

    __slots__ = ("_sent", "_sent_wall_at")

    def __init__(self) -> None:
        self._sent: Assessment | None = None
        self._sent_wall_at: datetime | None = None

    def is_news(self, assessment: Assessment, *, wall_at: datetime) -> bool:
        """Whether to send a sample: a value left its dead band, or the last sample is old."""
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
        """Compare with this assessment from now on."""
        self._sent, self._sent_wall_at = assessment, wall_at


def _strayed_m(sent: Assessment, now: Assessment) -> float:
    """Distance from the predicted position."""
    seconds = (now.at - sent.at).total_seconds()
    east_mps, north_mps = sent.velocity_mps
    predicted = moved(sent.position, east_m=east_mps * seconds, north_m=north_mps * seconds)
    return distance_m(predicted, now.position)


#: Least seconds between two samples, of fleet time and of wall time.
_EVERY_S = 1.0

_SAMPLED: Final = (Situation.FLYING, Situation.RECHARGING)


class TelemetrySender:
    """Sends the samples that are news, of those that the guard's looks offer."""

    def __init__(self, uplink: Uplink, clock: FleetClock) -> None:
        self._uplink = uplink
        self._clock = clock
        self._thinning = TelemetryThinning()
        #: Until then no further assessment is a sample.
        self._next_at = clock.now()
        #: The last assessment that was news, and when it was made, wall time.
        self._news: tuple[Assessment, datetime] | None = None
        self._has_news = asyncio.Event()

    def offer(self, assessment: Assessment, situation: Situation) -> None:
        """Send this soon if the drone flies or recharges, and if it is due and news."""
        if situation not in _SAMPLED or assessment.at < self._next_at:
            return
        self._next_at = assessment.at + fleet_margin(self._clock, fleet_s=_EVERY_S, wall_s=_EVERY_S)
        wall_at = self._clock.wall_now()
        if self._thinning.is_news(assessment, wall_at=wall_at):
            self._news = assessment, wall_at
            self._has_news.set()

    async def run(self) -> Never:
        """Send for ever; a sample that cannot be sent is dropped."""
        while True:
            await self._has_news.wait()
            self._has_news.clear()
            if self._news is not None:
                await self._send(*self._news)

    async def _send(self, assessment: Assessment, wall_at: datetime) -> None:
        sample = telemetry_of(assessment, envelope=self._uplink.envelope(TELEMETRY))
        try:
            await self._uplink.send(TELEMETRY, sample)
        except MqttUnavailable:
            return
        self._thinning.sent(assessment, wall_at=wall_at)


def telemetry_of(assessment: Assessment, *, envelope: Envelope) -> Telemetry:
    """The sample of this assessment, rounded to the precision of sensors."""
    return Telemetry(
        **envelope,
        at=assessment.at,
        position=assessment.position,
        soc=assessment.soc,
        power_w=round(assessment.power_w, 1),
        speed_mps=round(assessment.speed_mps, 2),
        voltage_v=round(assessment.voltage_v, 3),
        temperature_c=round(assessment.temperature_c, 1),
        range_m=round(assessment.range_m, 0),
    )
