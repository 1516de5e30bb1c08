"""A topic: a template of names, the message on it, who writes it and who reads it."""

from dataclasses import dataclass, field
from typing import Any, Generic, Literal, TypeVar

from pydantic import BaseModel, TypeAdapter

M = TypeVar("M", bound=BaseModel)

#: Who holds a broker account: a kind of client, or one service by its name.
BrokerRole = Literal["drone", "customer", "operator", "gateway", "registry", "composition"]


@dataclass(frozen=True, slots=True)
class Address(Generic[M]):
    """One concrete topic name, on which only its topic's message can be published."""

    topic: "Topic[M]"
    name: str


@dataclass(frozen=True, slots=True)
class Topic(Generic[M]):
    """One line of the contract, from which AsyncAPI, schemas and broker rules are generated.

    `template` holds placeholders: `{p}` provider, `{d}` drone, `{c}` customer, others by name.
    """

    template: str
    message: Any  # a model class, or an annotated union of them, which has no common static type
    mqtt_qos: Literal[0, 1]
    retained: bool
    writer: BrokerRole
    readers: tuple[BrokerRole, ...]
    about: str
    _adapter: TypeAdapter[M] = field(init=False, repr=False, compare=False)
    #: Where placeholders and words stand in the template, looked at for each message: most topics
    #: differ in their last word.
    _places: tuple[int, ...] = field(init=False, repr=False, compare=False)
    _words: tuple[tuple[int, str], ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        levels = list(enumerate(self.template.split("/")))
        places = tuple(place for place, level in levels if level.startswith("{"))
        words = tuple((place, level) for place, level in levels[::-1] if place not in places)
        object.__setattr__(self, "_adapter", TypeAdapter(self.message))
        object.__setattr__(self, "_places", places)
        object.__setattr__(self, "_words", words)

    def __call__(self, *ids: str) -> Address[M]:
        """The concrete topic for these ids, in the order of the placeholders."""
        levels = self.template.split("/")
        for place, value in zip(self._places, ids, strict=True):
            levels[place] = value
        return Address(self, "/".join(levels))

    @property
    def everywhere(self) -> str:
        """The filter that matches this topic for all ids."""
        return "/".join("+" if part.startswith("{") else part for part in self.template.split("/"))

    def ids_in(self, name: str) -> tuple[str, ...] | None:
        """The ids that a concrete name holds, or None when it is not of this topic."""
        levels = name.split("/")
        if len(levels) != len(self._places) + len(self._words):
            return None
        for place, word in self._words:
            if levels[place] != word:
                return None
        return tuple([levels[place] for place in self._places])

    def read(self, payload: bytes) -> M:
        """The message in a payload; fields that this version does not know are ignored."""
        return self._adapter.validate_json(payload, extra="ignore")

    def schema(self) -> dict[str, Any]:
        """The JSON Schema of the message."""
        return self._adapter.json_schema(mode="serialization")
