"""The rights of every account, and that Mosquitto's file says the same."""

from itertools import product

import pytest

from skyway.contracts.broker_rules import SERVICE_ACCOUNTS, BrokerRules
from skyway.contracts.topics import (
    ACKS,
    CLOCK,
    CONNECTION,
    DELIVERY_EVENTS,
    EVENTS,
    INSTRUCTIONS,
    NETWORK_VERSION,
    STATE,
    STATION_STATE,
    TELEMETRY,
    TOPICS,
)

RULES = BrokerRules()
#: Customers who bear the name of a drone and of a station.
NAMESAKES = ("drone-1", "station-1")
CUSTOMERS = ("customer-1", *NAMESAKES)
OPERATOR = "operator/olga"
ACCOUNTS = ("p/drone-1", "p/drone-2", "q/drone-1", *CUSTOMERS, OPERATOR, *sorted(SERVICE_ACCOUNTS))


def concrete_names() -> list[str]:
    """Every topic, with every account's name and an unknown name in every place."""
    ids = (
        "p",
        "q",
        "drone-2",
        *CUSTOMERS,
        *SERVICE_ACCOUNTS,
        "operator",
        "olga",
        "else",
        "stations",
    )
    names = {
        topic(*chosen).name
        for topic in TOPICS
        for chosen in product(ids, repeat=topic.template.count("{"))
    }
    # What a pattern of drones becomes with a name that has one part.
    names |= {f"skyway/v1/{name}/{word}" for name in ids for word in ("state", "instructions")}
    return sorted(names | {"skyway", "other/topic", "skyway/v1/p/drone-1/unknown", "$SYS/uptime"})


def allows(acl: str, user_name: str, access: str, topic: str) -> bool:
    """What Mosquitto makes of an ACL file: denials first, then user lines and patterns."""
    section = ""
    allowed = []
    for line in acl.splitlines():
        match line.split():
            case ["user", name]:
                section = name
            case ["pattern", given, allowed_topic]:
                allowed.append((given, allowed_topic.replace("%u", user_name)))
            case ["topic", given, allowed_topic] if section == user_name:
                allowed.append((given, allowed_topic))
    if any(
        given == "deny" and mqtt_matches(allowed_topic, topic) for given, allowed_topic in allowed
    ):
        return False
    return any(
        given == access and mqtt_matches(allowed_topic, topic) for given, allowed_topic in allowed
    )


def mqtt_matches(allowed_topic: str, topic: str) -> bool:
    parts, levels = allowed_topic.split("/"), topic.split("/")
    if parts[-1] == "#":
        return len(levels) >= len(parts) - 1 and all(
            part in ("+", level) for part, level in zip(parts[:-1], levels, strict=False)
        )
    return len(parts) == len(levels) and all(
        part in ("+", level) for part, level in zip(parts, levels, strict=True)
    )


@pytest.mark.parametrize("account", ACCOUNTS)
def test_the_file_for_mosquitto_gives_the_same_rights(account):
    is_service = account in SERVICE_ACCOUNTS
    acl = RULES.service_acl() if is_service else RULES.client_acl([OPERATOR])

    differing = [
        (access, name)
        for name in concrete_names()
        for access, ours in (("read", RULES.may_read), ("write", RULES.may_write))
        if ours(account, name) != allows(acl, account, access, name)
    ]

    assert differing == []


@pytest.mark.parametrize("topic", [ACKS, EVENTS, STATE, TELEMETRY, CONNECTION])
def test_a_drone_writes_its_own_reports_and_no_other_drones(topic):
    assert RULES.may_write("p/drone-1", topic("p", "drone-1").name)
    assert not RULES.may_write("p/drone-1", topic("p", "drone-2").name)
    assert not RULES.may_read("p/drone-1", topic("p", "drone-2").name)


@pytest.mark.parametrize("topic", [ACKS, EVENTS, STATE, TELEMETRY, CONNECTION])
def test_a_drone_writes_under_its_own_provider_only(topic):
    assert not RULES.may_write("p/drone-1", topic("q", "drone-1").name)
    assert not RULES.may_write("p/drone-1", topic("stations", "drone-1").name)


@pytest.mark.parametrize("account", CUSTOMERS)
def test_a_customer_writes_nothing_and_reads_no_instructions(account):
    assert [name for name in concrete_names() if RULES.may_write(account, name)] == []
    assert not any(
        RULES.may_read(account, INSTRUCTIONS(*ids).name)
        for ids in product((*NAMESAKES, "p"), repeat=2)
    )


def test_a_drone_reads_its_own_instructions_and_writes_none():
    assert RULES.may_read("p/drone-1", INSTRUCTIONS("p", "drone-1").name)
    assert not RULES.may_read("p/drone-1", INSTRUCTIONS("p", "drone-2").name)
    assert not RULES.may_write("p/drone-1", INSTRUCTIONS("p", "drone-1").name)


def test_a_customer_reads_its_own_delivery_events_alone():
    assert RULES.may_read("customer-1", DELIVERY_EVENTS("customer-1", "d").name)
    assert not RULES.may_read("customer-1", DELIVERY_EVENTS("customer-2", "d").name)
    assert not RULES.may_write("customer-1", DELIVERY_EVENTS("customer-1", "d").name)


@pytest.mark.parametrize("topic", [CLOCK(), STATION_STATE("s"), NETWORK_VERSION("n")])
def test_everybody_reads_what_is_about_the_world_and_no_drone_writes_it(topic):
    assert all(RULES.may_read(account, topic.name) for account in ACCOUNTS)
    assert not RULES.may_write("p/drone-1", topic.name)


def test_an_operator_reads_every_topic_and_writes_none():
    names = [topic(*["x"] * topic.template.count("{")).name for topic in TOPICS]

    assert all(RULES.may_read(OPERATOR, name) for name in names)
    assert not any(RULES.may_write(OPERATOR, name) for name in concrete_names())


def test_each_topic_is_written_by_its_writer_and_no_other_service():
    for topic in TOPICS:
        name = topic(*["x"] * topic.template.count("{")).name
        writers = {account for account in SERVICE_ACCOUNTS if RULES.may_write(account, name)}

        assert writers == {topic.writer} - {"drone"}


def test_a_service_is_no_drone_of_its_name():
    assert not RULES.may_write("gateway", STATE("p", "gateway").name)
    assert not RULES.may_read("registry", INSTRUCTIONS("p", "registry").name)


@pytest.mark.parametrize("user_name", ["+", "#", "p/drone-1/x", "", "%u", "p/+", "/drone-1", "p/"])
def test_an_account_named_like_a_wildcard_may_nothing(user_name):
    assert not RULES.may_read(user_name, INSTRUCTIONS("p", "drone-1").name)
    assert not RULES.may_write(user_name, STATE("p", user_name).name)


@pytest.mark.parametrize("topic", ["skyway/v1/+/drone-1/state", "skyway/v1/#/drone-1/state"])
def test_a_filter_is_no_topic_to_publish_on(topic):
    assert not RULES.may_write("p/drone-1", topic)
