"""The shops of the small world, and the people who get their packages; all names are made up."""

from collections.abc import Mapping
from dataclasses import dataclass
from random import Random
from types import MappingProxyType
from typing import Final

from skyway.ids import StationId


@dataclass(frozen=True, slots=True)
class Shop:
    """A customer: how its tracking pages look, and where its packages are picked up."""

    name: str
    colour: str
    stations: tuple[StationId, ...]
    #: What its packages are called.
    wares: tuple[str, ...]

    @property
    def branding(self) -> dict[str, str]:
        """The body of PUT /v1/branding."""
        return {"name": self.name, "colour": self.colour}


def _shop(name: str, colour: str, stations: str, wares: str) -> Shop:
    places = tuple(StationId(each) for each in stations.split())
    return Shop(name, colour, places, tuple(wares.split()))


#: The customer whose key is in keys.env.
OWN_SHOP: Final = _shop(
    "The Corner Shop", "#0b6bcb", "live-oak kirby", "coffee tea honey cheese olives"
)

#: The other customers, by their ids.
SHOPS: Final[Mapping[str, Shop]] = MappingProxyType(
    {
        "river-books": _shop(
            "River Books", "#7a3e1d", "new-braunfels marion", "novels atlas poems cookbook"
        ),
        "city-pharmacy": _shop(
            "City Pharmacy", "#1a7f4b", "alamo-heights san-antonio", "medicine bandages drops"
        ),
        "lantern-electronics": _shop(
            "Lantern Electronics",
            "#5b3fa0",
            "leon-valley shavano-park",
            "camera headphones batteries cable",
        ),
    }
)

_FIRST: Final = (
    "Ana Ben Clara Diego Elena Farid Grace Hugo Ines Jonas Kavya Liam Mei Noah Olga Pablo "
    "Quinn Rosa Samir Tessa Umar Vera Wen Yara Zoe"
)
_LAST: Final = (
    "Alvarez Brandt Chen Dunn Estrada Fischer Garcia Haddad Ito Jensen Kowalski Lopez Meyer "
    "Novak Okafor Perez Rao Silva Tran Vogel Weber Young"
)


def recipient(chance: Random) -> dict[str, str]:
    """Somebody who gets packages, as requests name a recipient."""
    return {"name": f"{chance.choice(_FIRST.split())} {chance.choice(_LAST.split())}"}
