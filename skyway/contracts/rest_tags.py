"""The tags of the REST operations, in the order of the documentation, each with what it holds."""

from collections.abc import Mapping
from typing import Final

TAGS: Final[Mapping[str, str]] = {
    "deliveries": "Customers request deliveries, follow them and cancel them.",
    "live": "The fleet as it is now, and what changes: drones, missions, pads, closures, alarms.",
    "quotes": "Customers ask for offers before they request a delivery.",
    "webhooks": "Customers have the events of their deliveries sent to a URL (Standard Webhooks).",
    "statements": "What customers pay and providers get, by month, and the lines that it sums.",
    "providers": "Operators register the owners of fleets; each provider keeps its own terms.",
    "drones": "Providers register their drones, change them and read what they measured.",
    "drone-models": "The types of drones, with mass, battery, speed and power.",
    "enrolment": "Drones exchange a one-time token for their own credentials.",
    "networks": "Operators publish skyway networks; everybody reads stations and segments.",
    "pads": "Who holds which recharging pad, and until when.",
    "compositions": "Plans for one drone and its packages, made without any side effect.",
    "missions": "Plans in flight: their progress, their loading, and an operator's commands.",
    "closures": "Operators close stations, pads, segments and areas, or stop all take-offs.",
    "alarms": "What needs the eyes of a person, and who has seen it.",
    "quarantine": "Messages of drones that could not be taken, for operators to look at.",
    "statistics": "Sums over deliveries, drones, pads and missions.",
    "keys": "API keys of customers, providers and operators.",
    "limits": "What the caller may use, and what is left of it.",
    "audit": "What operators and providers did.",
    "clock": "Fleet time, which can run faster than wall time.",
    "service": "Whether a process is alive and ready, and what it counts.",
    "internal": "Calls between Skyway's own services; nobody else may make them.",
}
