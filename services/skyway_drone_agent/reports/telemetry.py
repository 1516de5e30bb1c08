"""Telemetry: light samples while the drone moves or charges, fewer when nothing changes."""

from typing import Never

from skyway.contracts.drone_report import Telemetry
from skyway.contracts.topics import TELEMETRY
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.errors import MqttUnavailable
from skyway_drone_agent.analysis.analysis import Assessment
from skyway_drone_agent.analysis.lookout import Lookout
from skyway_drone_agent.journal.flight_recorder import FlightRecorder
from skyway_drone_agent.journal.under_way import run_under_way
from skyway_drone_agent.link.uplink import Envelope, Uplink
from skyway_drone_agent.reports.telemetry_thinning import TelemetryThinning

#: At most one sample per so many seconds of fleet time, and of wall time.
_EVERY_S = 1.0


class TelemetrySender:
    """Samples the drone during steps that change something."""

    def __init__(
        self, uplink: Uplink, recorder: FlightRecorder, lookout: Lookout, clock: FleetClock
    ) -> None:
        self._uplink = uplink
        self._recorder = recorder
        self._lookout = lookout
        self._clock = clock
        self._news = recorder.watch()
        self._thinning = TelemetryThinning()

    async def run(self) -> Never:
        """Sample for ever; a sample that the link does not take is not sent again."""
        while True:
            run = run_under_way(self._recorder.logbook)
            if run is None or run.step.kind not in ("FLY", "RECHARGE"):
                await self._news.wait()
                self._news.clear()
                continue
            now = self._clock.now()
            await self._send_news(self._lookout.newest())
            pause = fleet_margin(self._clock, fleet_s=_EVERY_S, wall_s=_EVERY_S)
            await self._clock.sleep_until(now + pause)

    async def _send_news(self, assessment: Assessment) -> None:
        wall_at = self._clock.wall_now()
        if not self._thinning.is_news(assessment, wall_at=wall_at):
            return
        sample = telemetry_of(assessment, envelope=self._uplink.envelope(TELEMETRY))
        try:
            await self._uplink.send(TELEMETRY, sample)
        except MqttUnavailable:
            return
        self._thinning.sent(assessment, wall_at=wall_at)


def telemetry_of(assessment: Assessment, *, envelope: Envelope) -> Telemetry:
    """The sample of this assessment, as finely as sensors see."""
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
