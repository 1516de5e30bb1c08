"""The gauges of composition."""

from collections import Counter
from dataclasses import dataclass
from typing import Final, get_args

from skyway.contracts.drone_report import AlarmLevel, Fault
from skyway.contracts.mission import OPEN_MISSION_STATES
from skyway.runtime.metrics import Gauge, GaugeSource
from skyway.runtime.outbox.outbox_store import OutboxGauges
from skyway.units import moment_to_ms
from skyway_composition import alarm_store, gauge_store
from skyway_composition.missions.timeout_store import unknown_missions
from skyway_composition.parts import Parts
from skyway_composition.tables import outbox

#: The codes of alarms that have a series of their own. A drone may choose any code, so all others
#: are counted together: codes must not make any number of series.
ALARM_CODES: Final = frozenset(
    {
        *(fault.value for fault in Fault),
        *alarm_store.OF_BUSINESS,
        "DIVERSION_IMPOSSIBLE",
        "DRONE_JUMPED",
        "FAILSAFE_ACTIVE",
        "FLIES_ON",
        "FORCED_LANDING",
        "FORGED_MESSAGES",
        "HAND_OVER_UNKNOWN",
        "HOLD_REFUSED",
        "PROOF_REFUSED",
        "IMPLAUSIBLE",
        "LATE_HAND_OVER",
        "LOADING_TIMEOUT",
        "MAINTENANCE_DUE",
        "MASS_MISMATCH",
        "MISSIONS_UNKNOWN",
        "MISSION_IN_DOUBT",
        "NO_SAFE_LANDING",
        "PACKAGE_MISSING",
        "REVISIONS_REFUSED",
        "SENDER_PUT_OUT",
    }
)
_OTHER: Final = "OTHER"


@dataclass(frozen=True, slots=True)
class CompositionGauges:
    """What stands at composition now."""

    parts: Parts

    def sources(self) -> tuple[GaugeSource, ...]:
        """Where the gauges come from."""
        messages = OutboxGauges(self.parts.db, outbox, ("mqtt", "gateway", "registry"))
        return (
            GaugeSource("missions", self._missions),
            GaugeSource("alarms", self._alarms),
            GaugeSource("outbox", messages.read),
            GaugeSource("planning", self._planning, kept_s=0.0),
        )

    async def _missions(self) -> list[Gauge]:
        async with self.parts.db.survey() as connection:
            by_state = await gauge_store.open_missions(connection)
            stuck = await gauge_store.stuck_missions(connection)
            quarantined = await gauge_store.quarantined_messages(connection)
            wall_ms = moment_to_ms(self.parts.clock.wall_now())
            unknown = await unknown_missions(connection, wall_ms=wall_ms)
        about = "missions that are not over"
        return [
            *(
                Gauge("skyway_missions", about, by_state.get(state, 0), {"state": state})
                for state in OPEN_MISSION_STATES
            ),
            Gauge("skyway_missions_to_replan", "missions that wait for a new plan", stuck),
            Gauge("skyway_unknown_missions", "missions unknown to the gateway", len(unknown)),
            Gauge("skyway_quarantine_depth", "messages that are set aside", quarantined),
        ]

    async def _alarms(self) -> list[Gauge]:
        async with self.parts.db.survey() as connection:
            found = await gauge_store.open_alarms(connection)
        shown: Counter[tuple[str, str]] = Counter()
        for (level, code), alarm_count in found.items():
            shown[level, code if code in ALARM_CODES else _OTHER] += alarm_count
        # A level without an open alarm is shown too: what is missing cannot be compared with 0.
        for level in get_args(AlarmLevel):
            shown[level, _OTHER] += 0
        about = "alarms that nobody has acknowledged"
        return [
            Gauge("skyway_alarms_open", about, alarm_count, {"level": level, "code": code})
            for (level, code), alarm_count in sorted(shown.items())
        ]

    async def _planning(self) -> list[Gauge]:
        parts = self.parts
        about = "plans that wait for a thread or are in one"
        return [
            Gauge("skyway_planning_depth", about, pool.under_way, {"queue": pool.name})
            for pool in (parts.solver, parts.inquiries, parts.problems)
        ]
