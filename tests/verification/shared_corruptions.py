"""Corruptions of shared missions: of a host, its guest, and their packages and prices."""

from typing import Final

from tests.verification.damaged_copies import Corruption

_SHARES: Final = "a shared mission has its own delivery and its guests as shares"
_OF_GUESTS: Final = " IN (SELECT delivery_id FROM guests)"
_CHANGE: Final = "UPDATE missions SET shares = json_set(shares, "

SHARED_CORRUPTIONS: Final = (
    Corruption(
        "half of the shares of a mission",
        "every stored text has its form",
        composition="UPDATE missions SET shares = '[{' WHERE shares IS NOT NULL",
    ),
    Corruption(
        "a guest of another attempt than its host says",
        _SHARES,
        composition="UPDATE guests SET attempt = 7",
    ),
    Corruption(
        "a host whose first share is of another delivery",
        _SHARES,
        composition=_CHANGE + "'$[0].delivery_id', 'dlv_other') WHERE shares IS NOT NULL",
    ),
    Corruption(
        "two packages that fly under one id",
        "each package of a shared mission flies under its own id",
        composition=_CHANGE
        + "'$[1].packages', json_extract(shares, '$[0].packages')) WHERE shares IS NOT NULL",
    ),
    Corruption(
        "a delivery that pays the pooled price alone",
        "a pooled price is paid together, and is no higher than the price alone",
        composition=_CHANGE + "'$[0].is_pooled', json('true')) WHERE shares IS NOT NULL",
    ),
    Corruption(
        "a price that rises on a shared trip",
        "a pooled price is paid together, and is no higher than the price alone",
        composition="UPDATE missions SET shares = json_set("
        "json_remove(shares, '$[1].pooled_price.line_items'), "
        "'$[1].pooled_price.amount', 999999) WHERE shares IS NOT NULL",
    ),
    Corruption(
        "a guest that is picked up further away than it allows",
        "a guest is picked up where it asked, or within the metres that it allows",
        composition=_CHANGE + "'$[1].near.away_m', 501.0) WHERE shares IS NOT NULL",
    ),
    Corruption(
        "a package that waits at another pickup than its mission has",
        "I6 packages pass from station to drone and from drone to station or recipient",
        gateway="UPDATE custody SET custodian_id = 'line-s4'"
        " WHERE delivery_id = :guest AND seq = 2;"
        " UPDATE packages SET custodian_id = 'line-s4' WHERE delivery_id = :guest",
    ),
    Corruption(
        "a package that waits further away than its customer allows",
        "I6 packages pass from station to drone and from drone to station or recipient",
        gateway="UPDATE deliveries SET request = json_set(request, '$.qos.pickup_within_m', 100.0)"
        " WHERE delivery_id = :guest",
    ),
    Corruption(
        "the chain of custody of a guest's package deleted",
        "I6 a package of a guest has a chain of custody",
        composition="DELETE FROM custody WHERE delivery_id" + _OF_GUESTS,
    ),
    Corruption(
        "a closed delivery that is still a guest",
        "a closed delivery is no guest of a mission that is not over",
        composition="UPDATE deliveries SET closed_ms = 1 WHERE delivery_id" + _OF_GUESTS,
    ),
)
