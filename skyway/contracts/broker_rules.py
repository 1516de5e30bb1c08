"""Who may read and write which topic, by the list of topics: the source of broker ACLs."""

import re
from collections.abc import Iterable
from functools import lru_cache
from typing import Any, Final, Literal, get_args

from skyway.contracts.topics import TOPICS, BrokerRole, Topic

Access = Literal["read", "write"]

#: The accounts with fixed names; every other account belongs to one client.
SERVICE_ACCOUNTS: Final = frozenset(get_args(BrokerRole)) - {"drone", "customer", "operator"}

#: People whose broker accounts are opened and closed with their API keys.
AccountRole = Literal["customer", "operator"]
ACCOUNT_ROLES: Final[tuple[AccountRole, ...]] = get_args(AccountRole)

#: How the user names of operators begin. Names of drones begin with their provider's id, which the
#: registry makes. Names of customers have no slash. So no name can be of two kinds.
_OPERATORS: Final = "operator/"

#: The placeholder for the account's own name in a rule, as Mosquitto writes it.
_OWN_NAME: Final = "%u"

#: The placeholders of a drone's or a customer's own name in a topic.
_OWN_PLACEHOLDERS: Final = {"drone": "{p}/{d}", "customer": "{c}"}

#: The user names of drones have two parts, all others one.
USER_NAME: Final = re.compile(r"[A-Za-z0-9_-]{1,64}(/[A-Za-z0-9_-]{1,64})?")

#: Cached decisions: about one for every (account, topic) of a fleet of 5,000.
_REMEMBERED: Final = 65_536

#: The first line of the files for Mosquitto.
_GENERATED: Final = "# Generated from skyway.contracts.topics; do not edit."

Rule = tuple[Access, str]


def drone_account(provider_id: str, drone_id: str) -> str:
    """The user name of a drone at the broker: the levels that its own topics begin with.

    So the broker lets a drone write under its own provider only, and lets no other account write
    there.
    """
    return f"{provider_id}/{drone_id}"


def operator_account(name: str) -> str:
    """The user name of an operator at the broker."""
    return _OPERATORS + name


def is_operator(user_name: str) -> bool:
    """Whether this is the user name of an operator."""
    return user_name.startswith(_OPERATORS)


#: The operator's account of the deployment itself, with which `skyway doctor` looks at the broker.
DEPLOYMENT_OPERATOR: Final = operator_account("deployment")


class BrokerRules:
    """The rights of every account, for the embedded broker and, as text, for Mosquitto.

    A service account has the rights that the list of topics gives its name. The name of a drone
    stands in the place of `{p}/{d}`, that of a customer in the place of `{c}`. Everyone may read
    what both drones and customers may read. A service account does not count as a customer of its
    name. An operator reads what the list of topics says, and writes nothing.
    """

    def __init__(self, topics: Iterable[Topic[Any]] = TOPICS) -> None:
        topics = tuple(topics)
        self._drones = tuple(_rules_of("drone", topics))
        self._customers = tuple(_rules_of("customer", topics))
        self._operators = tuple(_rules_of("operator", topics))
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
        return self._filters(user_name, "read")

    def writable(self, user_name: str) -> tuple[str, ...]:
        """Filters, none with `#`, outside of which this account may write nothing."""
        return self._filters(user_name, "write")

    def _filters(self, user_name: str, requested: Access) -> tuple[str, ...]:
        if not USER_NAME.fullmatch(user_name):
            return ()
        has_own = self._has_own_branch(user_name)
        filters = [
            allowed.replace(_OWN_NAME, user_name)
            for access, allowed in self._given_to(user_name)
            if access == requested and (has_own or _OWN_NAME not in allowed)
        ]
        return tuple(dict.fromkeys(filters))

    def client_acl(self, operators: Iterable[str] = (), locked_out: Iterable[str] = ()) -> str:
        """The rights of drones, customers and operators as an ACL file of Mosquitto.

        Parameters
        ----------
        operators
            The user names of all operators: Mosquitto knows roles by names only.
        locked_out
            The user names of drones that may do nothing any more, even if they are connected.
        """
        everyone = dict.fromkeys(self._drones + self._customers)
        lines = [_GENERATED, *(f"pattern {access} {allowed}" for access, allowed in everyone)]
        # A name without a slash is not a drone's: its drone patterns have one level too few.
        lines += [
            f"pattern deny {allowed.replace(_OWN_NAME, '+')}"
            for _, allowed in self._drones
            if _OWN_NAME in allowed
        ]
        for name in sorted(operators):
            lines += self._section(name)
            lines += [f"topic {access} {topic}" for access, topic in self._operators]
        for name in sorted(locked_out):
            lines += ["", f"user {name}", "topic deny #"]
        return "\n".join(lines) + "\n"

    def service_acl(self) -> str:
        """The rights of services as an ACL file of Mosquitto, for a listener of their own."""
        lines = [_GENERATED]
        for name, rules in self._services.items():
            allowed = dict.fromkeys(rules + self._customers)
            lines += self._section(name)
            lines += [
                f"topic {access} {topic}" for access, topic in allowed if _OWN_NAME not in topic
            ]
        return "\n".join(lines) + "\n"

    def _section(self, user_name: str) -> list[str]:
        """The first lines of a service's rights, which exclude drones and customers of its name."""
        denied = (branch.replace(_OWN_NAME, user_name) for branch in self._own_branches)
        return ["", f"user {user_name}", *(f"topic deny {branch}" for branch in denied)]

    def _decide(self, user_name: str, access: Access, topic: str) -> bool:
        # A name like "+" would match everybody's topics, and a topic with one is a filter.
        if not USER_NAME.fullmatch(user_name) or "+" in topic or "#" in topic:
            return False
        if not self._has_own_branch(user_name) and any(
            _matches(branch, topic, user_name) for branch in self._own_branches
        ):
            return False
        return any(
            access == given and _matches(allowed, topic, user_name)
            for given, allowed in self._given_to(user_name)
        )

    def _has_own_branch(self, user_name: str) -> bool:
        return user_name not in self._services and not is_operator(user_name)

    def _given_to(self, user_name: str) -> tuple[Rule, ...]:
        if is_operator(user_name):
            return self._operators
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
    required, levels = allowed.replace(_OWN_NAME, user_name).split("/"), topic.split("/")
    if required[-1] == "#":
        required = required[:-1]
        levels = levels[: len(required)]
    return len(required) == len(levels) and all(
        part in ("+", level) for part, level in zip(required, levels, strict=True)
    )
