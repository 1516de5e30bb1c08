"""The lines of the ledger that a change of a delivery causes: those of its new charges."""

from collections.abc import Iterator
from datetime import datetime

from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.deliveries.lifecycle.delivery import Delivery
from skyway_gateway.deliveries.lifecycle.delivery_parts import FlownMission
from skyway_gateway.ledger.line import LedgerLine, month_of


def new_lines(before: Delivery, after: Delivery, *, at: datetime) -> Iterator[LedgerLine]:
    """The lines of missions that have a charge now and had none before, written at this moment."""
    charged = {each.mission_id for each in before.missions if each.charged is not None}
    # The month is that of the stored moment, which has whole milliseconds.
    written_at = ms_to_moment(moment_to_ms(at))
    for mission in after.missions:
        if mission.charged is not None and mission.mission_id not in charged:
            yield from _lines_of(mission, after, written_at)


def _lines_of(mission: FlownMission, delivery: Delivery, at: datetime) -> Iterator[LedgerLine]:
    charged = mission.owed
    # What is free has a line too: it shows that the mission was settled.
    for number, item in enumerate(charged.itemised, 1):
        yield LedgerLine(
            mission_id=mission.mission_id,
            number=number,
            delivery_id=delivery.delivery_id,
            customer_id=delivery.customer_id,
            provider_id=mission.provider_id,
            kind=item.kind,
            amount=item.amount,
            currency=charged.currency,
            at=at,
            month=month_of(at),
        )
