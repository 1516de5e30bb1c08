"""The demo shows webhooks in the order of their moments."""

from skyway.cli.demo.webhook_receiver import Notification, NotificationOrder


def make_notification(sequence: int, minute: int) -> Notification:
    event = {"sequence": sequence, "occurred_at": f"2026-03-01T12:{minute:02}:00Z"}
    return Notification(f"wh_{sequence}", event, is_signed=True)


def sequences(notifications: list[Notification]) -> list[int]:
    return [notification.event["sequence"] for notification in notifications]


def test_a_webhook_that_arrives_late_is_shown_at_its_moment() -> None:
    order = NotificationOrder(hold_s=1.0)
    order.add(make_notification(4, 16), arrived_s=0.0)
    order.add(make_notification(5, 16), arrived_s=0.0)
    order.add(make_notification(6, 14), arrived_s=0.5)

    assert order.due(0.9) == []
    assert sequences(order.due(1.0)) == [6, 4, 5]
    assert order.remaining() == []


def test_a_webhook_of_a_later_moment_stays_held() -> None:
    order = NotificationOrder(hold_s=1.0)
    order.add(make_notification(1, 10), arrived_s=0.0)
    order.add(make_notification(2, 11), arrived_s=0.8)

    assert sequences(order.due(1.0)) == [1]
    assert sequences(order.remaining()) == [2]
