"""The experiments by name, in the order of the page."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from skyway.experiments.ablations import ablations
from skyway.experiments.booked_fleet import booked_fleet
from skyway.experiments.causes import causes
from skyway.experiments.congestion import congestion
from skyway.experiments.destinations import destinations
from skyway.experiments.flown import flown
from skyway.experiments.laboratory import Laboratory
from skyway.experiments.open_settings import open_settings
from skyway.experiments.paper import paper
from skyway.experiments.recharging import recharging
from skyway.experiments.scale import scale
from skyway.experiments.section import Section
from skyway.experiments.widening import widening

PARTS: Mapping[str, Callable[[Laboratory], Section]] = MappingProxyType(
    {
        "paper": paper,
        "open-settings": open_settings,
        "destinations": destinations,
        "widening": widening,
        "causes": causes,
        "recharging": recharging,
        "congestion": congestion,
        "booked-fleet": booked_fleet,
        "ablations": ablations,
        "flown": flown,
        "scale": scale,
    }
)
