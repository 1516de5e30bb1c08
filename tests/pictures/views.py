"""The pictures of docs/pictures: which views, on which screens."""

from dataclasses import dataclass
from typing import Final, Literal

Theme = Literal["light", "dark"]


@dataclass(frozen=True)
class Screen:
    """A size in pixels and a theme."""

    width: int
    height: int
    theme: Theme


#: By the end of a picture's name.
SCREENS: Final = {
    "light": Screen(1440, 900, "light"),
    "dark": Screen(1440, 900, "dark"),
    "phone": Screen(390, 844, "light"),
}

#: By the name of the picture: the role that sees the view, and the view's address. The names in
#: braces are those of `RecordedWorld.shown`. A recording looks at them in this order while drones
#: fly on, so views that must agree come first.
VIEWS: Final = {
    "delivery": ("operator", "deliveries/{delivery}"),
    "drone": ("operator", "map/drone/{drone}"),
    "home": ("operator", "home"),
    "map": ("operator", "map"),
    "station": ("operator", "map/station/{station}"),
    "schedule": ("operator", "schedule"),
    "deliveries": ("operator", "deliveries"),
    "fleet": ("operator", "fleet"),
    "alarms": ("operator", "alarms"),
    "statements": ("operator", "statements"),
    "replay": ("operator", "replay"),
    "health": ("operator", "health"),
    "home-of-provider": ("provider", "home"),
    "loading": ("provider", "fleet/loading"),
    "home-of-customer": ("customer", "home"),
    "new-delivery": ("customer", "new"),
    "keys": ("customer", "account"),
    "tracking": ("link", "{link}"),
}
