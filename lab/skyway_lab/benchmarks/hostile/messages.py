"""Messages of drones with an extreme value at one place, made from the contract."""

import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from pydantic import TypeAdapter
from skyway_lab.benchmarks.hostile.bodies import (
    Place,
    places,
    value_at,
    with_all_fields,
    with_value,
)
from skyway_lab.benchmarks.hostile.extremes import extremes_for

from skyway.contracts.topics import Topic

#: Numbers that order messages: after an extreme one the next messages are late, and are not read.
_ORDER: Final = frozenset(
    {"session", "seq", "stream", "connection_number", "last_instruction_seq", "last_event_seq"}
)


def extreme_messages(
    topic: Topic[Any], example: Callable[[], Mapping[str, Any]]
) -> Iterator[bytes]:
    """Every extreme value at every place of a message, those that order messages last.

    `example` makes a right message with new numbers.
    """
    schema = TypeAdapter(topic.message).json_schema()
    full = with_all_fields(dict(example()), schema, schema.get("$defs", {}))
    every: list[Place] = [place for place in places(full) if place]
    for place in sorted(every, key=lambda each: each[-1] in _ORDER):
        for value in extremes_for(value_at(full, place)):
            yield json.dumps(with_value(dict(example()), full, place, value)).encode()
