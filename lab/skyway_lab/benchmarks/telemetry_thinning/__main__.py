"""What thinning telemetry on board saves, and what an analysis costs.

`python -m skyway_lab.telemetry_thinning [--scenarios calm windy] [--seed 1]` flies one mission per
scenario at clock rate 1, second by second, and counts the samples and bytes of MQTT with every
second sent, and with only those samples that are news. The mission is
the same in both cases, and its length depends on the wind.
No broker is needed: nothing is lost or waited for.
"""

import argparse
import time
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from skyway_drone_agent.analysis.analysis import Analysis, Assessment
from skyway_drone_agent.link.uplink import Envelope
from skyway_drone_agent.messages.telemetry import TelemetryThinning, telemetry_of
from skyway_drone_agent.simulated.disturbances import changed, read_scenario
from skyway_lab.benchmarks.telemetry_thinning.flown import START, Flown
from skyway_lab.benchmarks.telemetry_thinning.round_trip import round_trip

from skyway.contracts.topics import TELEMETRY
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.ids import DroneId, ProviderId

#: Names as long as the registry mints them.
_HERE: Final = (ProviderId("prv_01kakz2m9x3v5w7y"), DroneId("drn_01kakz2m9x3v5w7y"))

#: Bytes of an MQTT PUBLISH of mqtt_qos 0 beside topic and payload, for payloads of this size.
_MQTT_BYTES: Final = 5


@dataclass(slots=True)
class Counted:
    """Samples and their bytes on the wire."""

    samples: int = 0
    sent_bytes: int = 0

    def add(self, assessment: Assessment) -> None:
        """Count this sample."""
        self.samples += 1
        envelope = Envelope(
            message_id="msg_01kakz2m9x3v5w7yabcd",
            sent_at=assessment.at,
            session=1_772_366_400,
            seq=self.samples,
        )
        payload = telemetry_of(assessment, envelope=envelope).model_dump_json()
        topic = TELEMETRY(*_HERE).name
        self.sent_bytes += len(payload) + len(topic) + _MQTT_BYTES


@dataclass(frozen=True, slots=True)
class Saving:
    """One mission: its seconds in flight and on a pad, every second sent and thinned."""

    seconds: int
    every: Counted
    news: Counted
    analysis_us: float


def fly(scenario: str, *, seed: int) -> Saving:
    """Fly the mission in this scenario."""
    disturbances = changed(read_scenario(scenario), {"seed": seed})
    steps = round_trip(DJI_MATRICE_300_RTK, start_at=START)
    flown = Flown(DJI_MATRICE_300_RTK, steps, disturbances, drone_id=_HERE[1])
    analysis, thinning = Analysis(flown.model), TelemetryThinning()
    every, news, cpu_s = Counted(), Counted(), 0.0
    taken = 0
    for moment in flown.moments():
        began_s = time.process_time()
        assessment = analysis.assess(moment.reading, moment.logbook)
        cpu_s += time.process_time() - began_s
        taken += 1
        if moment.run.step.kind not in ("FLY", "RECHARGE"):
            continue
        every.add(assessment)
        wall_at: datetime = assessment.at
        if thinning.is_news(assessment, wall_at=wall_at):
            thinning.sent(assessment, wall_at=wall_at)
            news.add(assessment)
    return Saving(every.samples, every, news, cpu_s / taken * 1e6)


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenarios", nargs="+", default=["calm", "windy", "stormy"])
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for scenario in given.scenarios:
        saving = fly(scenario, seed=given.seed)
        print(f"{scenario}: {saving.seconds} s in flight or on a pad")
        for name, counted in (("every second", saving.every), ("thinned", saving.news)):
            print(
                f"  {name:>12}: {counted.samples:5} samples, "
                f"{counted.samples / saving.seconds:.3f}/s, "
                f"{counted.sent_bytes / saving.seconds:6.1f} bytes/s"
            )
        saved = 1 - saving.news.sent_bytes / saving.every.sent_bytes
        print(f"  saved: {saved:.0%} of the bytes; an analysis takes {saving.analysis_us:.0f} us")


if __name__ == "__main__":
    main()
