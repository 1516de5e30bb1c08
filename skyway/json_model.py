"""The base of all models with a JSON form: frozen, and strict about unknown fields; a cache."""

from typing import Any, Final, Generic, Self, TypeVar

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler
from pydantic_core import CoreSchema

#: The validation of a longer list ends at its first wrong item: faults cost time, too.
_ALL_FAULTS_OF: Final = 100


def _end_early(schema: Any) -> None:  # a part of a core schema, which has no common static type
    """Let each long list end its validation at the first wrong item; inner models do so already."""
    if isinstance(schema, list | tuple):
        for each in schema:
            _end_early(each)
    elif isinstance(schema, dict) and schema.get("type") != "model":
        is_list = schema.get("type") == "list" or "variadic_item_index" in schema
        if is_list and schema.get("max_length", _ALL_FAULTS_OF + 1) > _ALL_FAULTS_OF:
            schema["fail_fast"] = True
        for each in schema.values():
            _end_early(each)


class JsonModel(BaseModel):
    """A frozen value with a JSON form; unknown fields, NaN and infinity are refused."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        populate_by_name=True,
        serialize_by_alias=True,
        protected_namespaces=(),
    )

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Pydantic's own schema (of any type `source`), in which long lists end early."""
        schema = own = handler(source)
        while own.get("type") != "model" and "schema" in own:  # validators of the model
            own = own["schema"]
        _end_early(own.get("schema"))
        return schema

    @classmethod
    def read(cls, raw: bytes | str) -> Self:
        """The value in this JSON; fields that this version does not know are ignored."""
        return cls.model_validate_json(raw, extra="ignore")


class WireModel(JsonModel):
    """A `JsonModel` between Skyway's own processes: fields of a newer writer are ignored."""

    model_config = ConfigDict(extra="ignore")


J = TypeVar("J", bound=JsonModel)


class JsonCache(Generic[J]):
    """Values of one model by their JSON; all readers of a text share its frozen value.

    The text comes from a database each time. After a change by another process the text differs and
    is parsed, so a cached value is never out of date. The oldest values are dropped.
    """

    def __init__(self, model: type[J], *, most: int) -> None:
        self._model = model
        self._most = most
        self._values: dict[str, J] = {}
        #: The text of each cached value, by the value's identity.
        self._texts: dict[int, str] = {}

    def write(self, value: J) -> str:
        """The JSON of a value, which is cached from now on."""
        text = self._texts.get(id(value))
        if text is None:
            text = value.model_dump_json()
            self._keep(text, value)
        return text

    def read(self, text: str) -> J:
        """The value in this JSON."""
        value = self._values.get(text)
        if value is None:
            value = self._model.read(text)
            self._keep(text, value)
        return value

    def _keep(self, text: str, value: J) -> None:
        # A cached value lives, so no other value has its identity.
        self._drop(text)
        self._values[text], self._texts[id(value)] = value, text
        while len(self._values) > self._most:
            self._drop(next(iter(self._values)))

    def _drop(self, text: str) -> None:
        dropped = self._values.pop(text, None)
        if dropped is not None:
            del self._texts[id(dropped)]
