"""The network of a caller, whose budget callers without a valid key spend."""

from functools import lru_cache
from ipaddress import IPv6Address, ip_address, ip_network


@lru_cache(maxsize=4096)
def network_of(host: str) -> str:
    """The IPv4 address, or the /64 of an IPv6 address; empty when the text is no address."""
    try:
        address = ip_address(host[:64])
    except ValueError:
        return ""  # a proxy that is trusted named no address
    if isinstance(address, IPv6Address):
        return str(address.ipv4_mapped or ip_network((address, 64), strict=False))
    return str(address)
