"""The printed figures of requests, received events and accepted samples."""

from datetime import UTC, datetime

from skyway_lab.benchmarks.load.burst import Burst, read_burst
from skyway_lab.benchmarks.load.cpu import CpuReading
from skyway_lab.benchmarks.load.figures import Outcome, Usage
from skyway_lab.benchmarks.load.follow import Followed
from skyway_lab.benchmarks.load.send import Sent

from skyway.contracts.delivery_event import DeliveryEvent, DeliveryEventType
from skyway.ids import DeliveryId, EventId

AT = datetime(2026, 3, 1, tzinfo=UTC)


def make_burst(*options: str) -> Burst:
    return read_burst(["--rate-per-s", "2", "--seconds", "10", *options])


def report(followed: Followed, delivery: str, kind: str, at_s: float, **data: object) -> None:
    event = DeliveryEvent(
        message_id="m",
        sent_at=AT,
        event_id=EventId("e"),
        type=DeliveryEventType(kind),
        delivery_id=DeliveryId(delivery),
        sequence=1,
        occurred_at=AT,
        data=data,
    )
    followed.note(event, at_s)


def make_outcome(followed: Followed, sent: Sent, busy: dict[str, float], *options: str) -> Outcome:
    idle = CpuReading(dict.fromkeys(busy, 1.0), machine_s=0.0)
    return Outcome(
        burst=make_burst(*options),
        started_s=100.0,
        sent=sent,
        followed=followed,
        usage=Usage(idle=idle, idle_s=10.0, busy=CpuReading(busy, machine_s=30.0), busy_s=20.0),
        counted={},
        violations="0 violations in 3 databases",
    )


def test_dispatches_within_the_burst_make_its_rate() -> None:
    followed, sent = Followed(), Sent(asked_at={DeliveryId("a"): 100.0, DeliveryId("b"): 101.0})
    report(followed, "a", "delivery.dispatched", 101.5)
    report(followed, "a", "delivery.dispatched", 109.0)  # a copy
    report(followed, "b", "delivery.dispatched", 111.0)

    rows = {row[0]: row[1] for row in make_outcome(followed, sent, {}).rows()}

    assert rows["dispatched a second of the burst"] == "0.1"
    assert rows["request to dispatch, p50 / p99"] == "1500 ms / 10000 ms"
    assert rows["planned, dispatched in the end"] == "0, 2"


def test_rejections_are_counted_by_their_reasons() -> None:
    followed = Followed()
    for delivery in ("a", "b"):
        reasons = [{"code": "BUSY"}, {"code": "OVERWEIGHT"}, {"code": "BUSY"}]
        report(followed, delivery, "delivery.rejected", 101.0, reasons=reasons)

    rows = {row[0]: row[1] for row in make_outcome(followed, Sent(), {}).rows()}

    assert rows["rejected"] == "2: 2 BUSY, OVERWEIGHT"
    assert followed.are_settled(2)
    assert not followed.are_settled(3)


def test_what_a_process_takes_when_idle_is_no_deliverys_cost() -> None:
    followed = Followed()
    for number in range(10):
        report(followed, f"d{number}", "delivery.dispatched", 101.0)

    rows = make_outcome(followed, Sent(), {"gateway": 6.0}).cpu_rows()

    # Idle a tenth of a core, so 2 of the 6 seconds in 20.
    assert rows[0] == ("gateway", "0.10", "0.30", "400.0")
    assert rows[-1] == ("everybody else", "", "1.20", "")


def test_the_cost_of_whole_flights_is_shared_by_completed_deliveries() -> None:
    followed = Followed()
    for number in range(10):
        report(followed, f"d{number}", "delivery.dispatched", 101.0)
    for number in range(5):
        report(followed, f"d{number}", "delivery.completed", 111.0)

    rows = make_outcome(followed, Sent(), {"gateway": 6.0}, "--flown").cpu_rows()

    assert rows[0] == ("gateway", "0.10", "0.30", "800.0")
