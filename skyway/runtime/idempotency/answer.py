"""An answer that may be given again."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Answer:
    """An HTTP answer as it was first given."""

    status: int
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)
    #: Whether it was remembered, and nothing happened this time.
    is_replayed: bool = field(default=False, compare=False)
