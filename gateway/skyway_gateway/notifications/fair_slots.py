"""Which endpoints are served now: their slots are shared between tenants and destinations.

An endpoint that did not answer keeps its slot for as long as a request may take. So no customer and
no destination may have many slots, and all endpoints that did not answer the last time have only a
part of them together. At one destination one customer has half of the slots at most, and so have
the silent endpoints: customers of one large receiver do not delay each other. Of the others, the
one that was served longest ago comes first.
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
    def half_of_destination(self) -> int:
        """Of one host and port: of one customer there, and of those that did not answer there."""
        return max(self.per_destination // 2, 1)

    @property
    def silent(self) -> int:
        """Of those that did not answer the last time."""
        return max(self.all * 3 // 8, 1)


@dataclass(slots=True)
class FairSlots:
    """The slots of one process."""

    limits: SlotLimits = field(default_factory=SlotLimits)
    most_remembered: int = 10_000
    #: The endpoints that are served now, with the names of what their slots count for.
    _served: dict[WebhookId, tuple[str, ...]] = field(default_factory=dict)
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
        for name in self._served.pop(endpoint.webhook_id, ()):
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
        if is_silent and len(self._served.keys() & self._silent.keys()) >= limits.silent:
            return False
        shares = self._shares(endpoint, is_silent=is_silent)
        if any(self._used[name] >= most for name, most in shares.items()):
            return False
        self._served[webhook_id] = tuple(shares)
        self._used.update(shares.keys())
        self._choices += 1
        self._chosen.pop(webhook_id, None)
        self._chosen[webhook_id] = self._choices
        self._forget_first(self._chosen)
        return True

    def _shares(self, endpoint: Endpoint, *, is_silent: bool) -> dict[str, int]:
        """What an endpoint's slot counts for, and how many slots each of these may have."""
        customer = f"customer {endpoint.customer_id}"
        destination = f"destination {urlsplit(endpoint.url).netloc}"
        limits, half = self.limits, self.limits.half_of_destination
        silent = {f"silent at {destination}": half} if is_silent else {}
        return {
            customer: limits.per_customer,
            destination: limits.per_destination,
            f"{customer} at {destination}": half,
            **silent,
        }

    def _forget_first(self, remembered: dict[WebhookId, None] | dict[WebhookId, int]) -> None:
        if len(remembered) > self.most_remembered:
            remembered.pop(next(iter(remembered)))
