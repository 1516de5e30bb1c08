"""Which endpoints are served now: their slots are shared between tenants and destinations.

An endpoint that did not answer keeps its slot for as long as a request may take. So no customer and
no destination may have many slots, and all endpoints that did not answer the last time have only a
part of them together. Of the others, the one that was served longest ago comes first.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from skyway.ids import WebhookId
from skyway_gateway.notifications.webhook import Endpoint


@dataclass(frozen=True, slots=True)
class SlotLimits:
    """How many endpoints are served at the same time: of all, and of one customer."""

    all: int = 256
    per_customer: int = 32

    @property
    def per_destination(self) -> int:
        """Of one host and port, also when several customers use it."""
        return max(self.per_customer // 2, 1)

    @property
    def silent(self) -> int:
        """Of those that did not answer the last time."""
        return max(self.all * 3 // 8, 1)


@dataclass(slots=True)
class FairSlots:
    """The slots of one process."""

    limits: SlotLimits = field(default_factory=SlotLimits)
    most_remembered: int = 10_000
    _served: set[WebhookId] = field(default_factory=set)
    _used: Counter[str] = field(default_factory=Counter)
    #: The endpoints that did not answer the last time.
    _silent: dict[WebhookId, None] = field(default_factory=dict)
    #: When each endpoint was last chosen, as a count of choices; the last one is last.
    _chosen: dict[WebhookId, int] = field(default_factory=dict)
    _choices: int = 0

    def choose(self, due: Iterable[Endpoint]) -> list[Endpoint]:
        """The endpoints to serve now; each takes a slot until `release`."""
        waiting = [each for each in due if each.webhook_id not in self._served]
        waiting.sort(key=lambda each: self._chosen.get(each.webhook_id, 0))
        return [each for each in waiting if self._claim(each)]

    def release(self, endpoint: Endpoint) -> None:
        """Free the slot of an endpoint that was chosen."""
        self._served.discard(endpoint.webhook_id)
        for name in _shares(endpoint):
            self._used[name] -= 1
            if self._used[name] <= 0:
                del self._used[name]

    def note_reply(self, webhook_id: WebhookId, *, is_answer: bool) -> None:
        """Remember whether an endpoint answers."""
        self._silent.pop(webhook_id, None)
        if not is_answer:
            self._silent[webhook_id] = None
            self._forget_first(self._silent)

    def _claim(self, endpoint: Endpoint) -> bool:
        webhook_id, limits = endpoint.webhook_id, self.limits
        if len(self._served) >= limits.all:
            return False
        is_silent = webhook_id in self._silent
        if is_silent and len(self._served & self._silent.keys()) >= limits.silent:
            return False
        customer, destination = _shares(endpoint)
        if (
            self._used[customer] >= limits.per_customer
            or self._used[destination] >= limits.per_destination
        ):
            return False
        self._served.add(webhook_id)
        self._used.update((customer, destination))
        self._choices += 1
        self._chosen.pop(webhook_id, None)
        self._chosen[webhook_id] = self._choices
        self._forget_first(self._chosen)
        return True

    def _forget_first(self, remembered: dict[WebhookId, None] | dict[WebhookId, int]) -> None:
        if len(remembered) > self.most_remembered:
            remembered.pop(next(iter(remembered)))


def _shares(endpoint: Endpoint) -> tuple[str, str]:
    """What an endpoint's slot counts for: its customer, and its host and port."""
    return f"customer {endpoint.customer_id}", f"destination {urlsplit(endpoint.url).netloc}"
