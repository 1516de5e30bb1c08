"""Pods may speak with whom they need, and with nobody else."""

from collections.abc import Iterator
from typing import Any

import pytest

from skyway.cli.system.service_secrets import PEERS
from tests.chart.rendered import Document, Documents, Outcomes, Pod, selects

pytestmark = pytest.mark.long

#: A pod, the pod that it calls, and the port.
Call = tuple[str, str, int]

PORTS = {"gateway": 8000, "registry": 8001, "composition": 8002}
#: The services recognise these callers by their secrets; nobody else needs to reach them.
SERVICE_CALLS = {
    (caller, name, PORTS[name]) for name, callers in PEERS.items() for caller in callers
}
AGENT_CALLS = {("agents", "gateway", 8000)}
BROKER_CALLS = {
    ("gateway", "registry", 1884),
    ("composition", "registry", 1884),
    ("agents", "registry", 1883),
}


def calls(found: Documents) -> Iterator[Call]:
    """The calls between pods that policies of both sides allow."""
    pods = {pod.component: pod for pod in found.pods()}
    for source in pods.values():
        for target in pods.values():
            for port in target.ports.values():
                leaves = any(may(r, "to", target, port) for r in rules(found, source, "egress"))
                enters = any(may(r, "from", source, port) for r in rules(found, target, "ingress"))
                if leaves and enters and source is not target:
                    yield source.component, target.component, port


def rules(found: Documents, pod: Pod, direction: str) -> Iterator[Document]:
    """The rules of all policies that hold for a pod."""
    for policy in found.of("NetworkPolicy"):
        if selects(policy["spec"]["podSelector"], pod.labels):
            yield from policy["spec"].get(direction, ())


def may(rule: Document, side: str, other: Pod, port: int) -> bool:
    """Whether a rule allows the other pod at a port."""
    in_ports = any(
        each["port"] <= port <= each.get("endPort", each["port"]) for each in rule["ports"]
    )
    peers: list[Any] = rule.get(side, [{"podSelector": {"matchLabels": {}}}])
    return in_ports and any(
        "podSelector" in each and selects(each["podSelector"], other.labels) for each in peers
    )


def test_pods_may_make_exactly_the_calls_that_they_need(outcomes: Outcomes) -> None:
    assert set(calls(outcomes["everything"])) == SERVICE_CALLS | AGENT_CALLS | BROKER_CALLS


def test_a_broker_outside_is_not_looked_for_in_the_registry(outcomes: Outcomes) -> None:
    found = outcomes["outside broker"]

    assert set(calls(found)) == SERVICE_CALLS | AGENT_CALLS
    for name in ("gateway", "composition", "registry"):
        pod = found.running()[name]
        rule = next(r for r in rules(found, pod, "egress") if r["ports"][0]["port"] == 1884)
        assert rule["to"] == [{"ipBlock": {"cidr": "10.2.0.0/16"}}]


def test_a_cell_makes_the_calls_of_a_composition_and_no_cell_calls_another(
    outcomes: Outcomes,
) -> None:
    found = set(calls(outcomes["cells"]))
    of_cells = {
        (source.replace("composition", cell), target.replace("composition", cell), port)
        for cell in ("cell-texas", "cell-north")
        for source, target, port in SERVICE_CALLS | BROKER_CALLS
    }

    without_agents = {
        each for each in SERVICE_CALLS | BROKER_CALLS | of_cells if "agents" not in each
    }
    assert found == without_agents


@pytest.mark.parametrize("case", ["default", "everything", "outside broker", "cells"])
def test_every_pod_is_closed_in_both_directions(outcomes: Outcomes, case: str) -> None:
    found = outcomes[case]
    for pod in found.pods():
        closed = [
            policy["spec"]["policyTypes"]
            for policy in found.of("NetworkPolicy")
            if selects(policy["spec"]["podSelector"], pod.labels)
        ]
        assert ["Ingress", "Egress"] in closed, pod.name


def test_services_reach_the_database_and_nothing_else_outside(outcomes: Outcomes) -> None:
    found = outcomes["everything"]
    for pod in found.pods():
        to_database = [
            each["to"]
            for each in rules(found, pod, "egress")
            if each["ports"] == [{"protocol": "TCP", "port": 5432}]
        ]
        needed = [] if pod.component == "agents" else [[{"ipBlock": {"cidr": "10.1.0.0/16"}}]]
        assert to_database == needed, pod.name


def test_only_the_gateway_reaches_the_internet_and_never_private_networks(
    outcomes: Outcomes,
) -> None:
    found = outcomes["everything"]
    for pod in found.pods():
        blocks = [
            peer["ipBlock"]
            for rule in rules(found, pod, "egress")
            for peer in rule.get("to", ())
            if "ipBlock" in peer
        ]
        wide = {each["cidr"]: each["except"] for each in blocks if each["cidr"].endswith("/0")}
        assert wide.keys() == ({"0.0.0.0/0", "::/0"} if pod.component == "gateway" else set())
        if wide:
            private = {"10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16"}
            assert private <= set(wide["0.0.0.0/0"])


def test_drones_come_from_their_networks_only(outcomes: Outcomes) -> None:
    registry = outcomes["everything"].running()["registry"]

    rule = next(
        each
        for each in rules(outcomes["everything"], registry, "ingress")
        if each["ports"] == [{"protocol": "TCP", "port": 18883}]
    )

    assert rule["from"] == [{"ipBlock": {"cidr": "198.51.100.0/24"}}]
