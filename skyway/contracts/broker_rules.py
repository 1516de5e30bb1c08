"""Who may read and write which topic, from the topics' own lines: the source of broker ACLs."""

import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Any, Final, Literal, get_args

from skyway.contracts.topics import TOPICS, BrokerRole, Topic

Access = Literal["read", "write"]

#: The accounts that are known by name; every other account is a drone's or a customer's own.
#: A drone's user name has a slash, and no other name has one: so no name is both.
SERVICE_ACCOUNTS: Final = frozenset(get_args(BrokerRole)) - {"drone", "customer"}

#: What stands for the account's own name in a rule, as Mosquitto writes it.
_OWN_NAME: Final = "%u"

#: Where a drone or a customer finds its own name in a topic.
_OWN_PLACEHOLDERS: Final = {"drone": "{p}/{d}", "customer": "{c}"}

#: The user names of drones have two parts, all others one.
USER_NAME: Final = re.compile(r"[A-Za-z0-9_-]{1,64}(/[A-Za-z0-9_-]{1,64})?")

#: Decisions remembered: about every (account, topic) of a fleet of 5,000.
_REMEMBERED: Final = 65_536

Rule = tuple[Access, str]


def drone_account(provider_id: str, drone_id: str) -> str:
    """The user name of a drone at the broker: the levels that its own topics begin with.

    So the broker lets a drone write under its own provider only, and nobody else at all.
    """
    return f"{provider_id}/{drone_id}"


class BrokerRules:
    """The rights of every account, for the embedded broker and, as text, for Mosquitto.

    A service account has what its name has in the topics' lines. A drone has the own name in the
    place of `{p}/{d}`, a customer in the place of `{c}`. Everyone reads what both may read about
    the world. A service account does not count as a customer of its name.
    """

    def __init__(self, topics: Iterable[Topic[Any]] = TOPICS) -> None:
        topics = tuple(topics)
        self._drones = tuple(_rules_of("drone", topics))
        self._customers = tuple(_rules_of("customer", topics))
        self._services = {name: tuple(_rules_of(name, topics)) for name in sorted(SERVICE_ACCOUNTS)}
        self._own_branches = tuple(dict.fromkeys(_own_branches(topics)))
        self._may = lru_cache(_REMEMBERED)(self._decide)

    def may_read(self, user_name: str, topic: str) -> bool:
        """Whether a message on this topic may be delivered to this account."""
        return self._may(user_name, "read", topic)

    def may_write(self, user_name: str, topic: str) -> bool:
        """Whether this account may publish on this topic."""
        return self._may(user_name, "write", topic)

    def readable(self, user_name: str) -> tuple[str, ...]:
        """Filters, none with `#`, outside of which this account may read nothing."""
        if not USER_NAME.fullmatch(user_name):
            return ()
        return tuple(
            allowed.replace(_OWN_NAME, user_name)
            for access, allowed in self._given_to(user_name)
            if access == "read"
        )

    def mosquitto_acl(self) -> str:
        """The same rights as an ACL file of Mosquitto."""
        lines = ["# Generated from skyway.contracts.topics; do not edit."]
        everyone = dict.fromkeys(self._drones + self._customers)
        lines += [f"pattern {access} {allowed}" for access, allowed in everyone]
        # A name without a slash is no drone's: its patterns of drones have a level too few.
        lines += [
            f"pattern deny {allowed.replace(_OWN_NAME, '+')}"
            for _, allowed in self._drones
            if _OWN_NAME in allowed
        ]
        for name, rules in self._services.items():
            lines += ["", f"user {name}"]
            lines += [
                f"topic deny {branch.replace(_OWN_NAME, name)}" for branch in self._own_branches
            ]
            lines += [f"topic {access} {allowed}" for access, allowed in rules]
        return "\n".join(lines) + "\n"

    def _decide(self, user_name: str, access: Access, topic: str) -> bool:
        # A name like "+" would match everybody's topics, and a topic with one is a filter.
        if not USER_NAME.fullmatch(user_name) or "+" in topic or "#" in topic:
            return False
        if user_name in self._services and any(
            _matches(branch, topic, user_name) for branch in self._own_branches
        ):
            return False
        return any(
            access == given and _matches(allowed, topic, user_name)
            for given, allowed in self._given_to(user_name)
        )

    def _given_to(self, user_name: str) -> tuple[Rule, ...]:
        own = self._drones if "/" in user_name else self._customers
        return self._services.get(user_name, ()) + own


def _rules_of(role: str, topics: Iterable[Topic[Any]]) -> Iterable[Rule]:
    own = _OWN_PLACEHOLDERS.get(role)
    for topic in topics:
        allowed = _filter(topic.template, own)
        if role == topic.writer:
            yield ("write", allowed)
        if role in topic.readers:
            yield ("read", allowed)


def _own_branches(topics: Iterable[Topic[Any]]) -> Iterable[str]:
    """The filters below which a drone or a customer of some name has its topics."""
    for topic in topics:
        for own in _OWN_PLACEHOLDERS.values():
            head, found, _ = topic.template.partition(own)
            if found:
                yield _filter(head + own, own) + "/#"


def _filter(template: str, own: str | None) -> str:
    """The MQTT filter of a template, with the account's own name at its placeholder."""
    named = template if own is None else template.replace(own, _OWN_NAME)
    return "/".join("+" if level.startswith("{") else level for level in named.split("/"))


def _matches(allowed: str, topic: str, user_name: str) -> bool:
    wanted, levels = allowed.replace(_OWN_NAME, user_name).split("/"), topic.split("/")
    if wanted[-1] == "#":
        wanted = wanted[:-1]
        levels = levels[: len(wanted)]
    return len(wanted) == len(levels) and all(
        part in ("+", level) for part, level in zip(wanted, levels, strict=True)
    )
