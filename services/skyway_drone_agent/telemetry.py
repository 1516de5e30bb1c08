"""Telemetry: light samples while the drone moves or charges, fewer when nothing changes."""

from typing import Never

from skyway.contracts.drone_report import Telemetry
from skyway.contracts.topics import TELEMETRY
from skyway.runtime.clock import FleetClock, fleet_margin
from skyway.runtime.errors import MqttUnavailable
from skyway_drone_agent.flight_recorder import FlightRecorder
from skyway_drone_agent.uplink import Uplink
from skyway_drone_agent.vehicle import Sample, Vehicle, run_under_way

#: At most one sample per so many seconds of fleet time, and of wall time.
_EVERY_S = 1.0


class TelemetrySender:
    """Samples the vehicle during steps that change something."""

    def __init__(
        self, uplink: Uplink, recorder: FlightRecorder, vehicle: Vehicle, clock: FleetClock
    ) -> None:
        self._uplink = uplink
        self._recorder = recorder
        self._vehicle = vehicle
        self._clock = clock
        self._news = recorder.watch()
        self._last: Sample | None = None

    async def run(self) -> Never:
        """Sample for ever; a sample that the link does not take is not sent again."""
        while True:
            run = run_under_way(self._recorder.logbook)
            if run is None or run.step.kind not in ("FLY", "RECHARGE"):
                await self._news.wait()
                self._news.clear()
                continue
            now = self._clock.now()
            await self._send(self._vehicle.sample(run, now))
            pause = fleet_margin(self._clock, fleet_s=_EVERY_S, wall_s=_EVERY_S)
            await self._clock.sleep_until(now + pause)

    async def _send(self, sample: Sample) -> None:
        if sample == self._last:
            return
        message = Telemetry(
            **self._uplink.envelope(TELEMETRY),
            at=self._clock.now(),
            position=sample.position,
            soc=sample.soc,
            power_w=sample.power_w,
            speed_mps=sample.speed_mps,
        )
        try:
            await self._uplink.send(TELEMETRY, message)
        except MqttUnavailable:
            return
        self._last = sample
