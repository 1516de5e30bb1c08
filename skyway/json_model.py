"""The base of all models with a JSON form: frozen, strict about types and fields; a cache."""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, ClassVar, Final, Generic, Self, TypeVar

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError
from pydantic_core import CoreSchema, PydanticCustomError
from pydantic_core.core_schema import no_info_before_validator_function

from skyway.errors import InvalidInput

#: The validation of a longer list ends at its first wrong item: faults cost time, too.
_ALL_FAULTS_OF: Final = 100

#: Sets an attribute of a frozen value.
_set: Final = object.__setattr__

#: Types for which no other type of JSON may stand: "5" and true are no numbers, 1 is not true.
_STRICT: Final = ("bool", "float")


def _whole(value: Any) -> Any:  # any JSON value
    """The value, unless it only passes for a whole number; 5.0 is one."""
    if isinstance(value, bool | str | bytes):
        raise PydanticCustomError("whole_number", "must be a whole number")
    return value


def _tighten(schema: Any) -> None:  # a part of a core schema, which has no common static type
    """Take each scalar in its own JSON type only, and end long lists at the first wrong item.

    Inner models do so already.
    """
    if isinstance(schema, list | tuple):
        for each in schema:
            _tighten(each)
    elif isinstance(schema, dict) and schema.get("type") != "model":
        if schema.get("type") == "function-before" and schema["function"]["function"] is _whole:
            return  # the same schema comes again when another type refers to its model
        if schema.get("type") in _STRICT:
            schema["strict"] = True
        is_list = schema.get("type") == "list" or "variadic_item_index" in schema
        if is_list and schema.get("max_length", _ALL_FAULTS_OF + 1) > _ALL_FAULTS_OF:
            schema["fail_fast"] = True
        for each in schema.values():
            _tighten(each)
        if schema.get("type") == "int":
            checked = no_info_before_validator_function(_whole, {**schema})
            schema.clear()
            schema.update(checked)


@cache
def _names_of(model: type[BaseModel]) -> set[str]:
    """The names of all members; many values share this set, and changed copies have their own."""
    return set(model.model_fields)


class JsonModel(BaseModel):
    """A frozen value with a JSON form; unknown fields, other types and NaN are refused."""

    #: Whether numbers come as text.
    takes_text: ClassVar[bool] = False

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
        """Pydantic's own schema (of any type `source`), strict about scalars and long lists."""
        schema = own = handler(source)
        while own.get("type") != "model" and "schema" in own:  # validators of the model
            own = own["schema"]
        if not cls.takes_text:
            _tighten(own.get("schema"))
        return schema

    def __iter__(self) -> Iterator[tuple[str, Any]]:  # type: ignore[override]  # as pydantic's own
        """The members by name; a cached property is none."""
        fields = type(self).model_fields
        yield from [(name, value) for name, value in self.__dict__.items() if name in fields]

    def merged(self, changes: "JsonModel") -> Self:
        """The value with the members that `changes` gives, inside of its objects too (RFC 7396).

        Raises
        ------
        InvalidInput
            Members that are changed do not fit those that stay.
        """
        given = {name: getattr(changes, name) for name in changes.model_fields_set}
        for name, value in given.items():
            before = getattr(self, name, None)
            if isinstance(value, JsonModel) and isinstance(before, JsonModel):
                try:
                    given[name] = before.merged(value)
                except InvalidInput as fault:
                    field = f"{name}.{fault.field}".rstrip(".")
                    raise InvalidInput(field, fault.detail) from fault
        return self.checked({**dict(self), **given})

    @classmethod
    def checked(cls, values: Mapping[str, Any]) -> Self:
        """The value with these members, of any JSON types.

        Raises
        ------
        InvalidInput
            They do not fit together; the error names the first fault.
        """
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            first = error.errors()[0]
            field = ".".join(map(str, first["loc"]))
            raise InvalidInput(field, first["msg"].removeprefix("Value error, ")) from error

    @classmethod
    def of_members(cls, members: dict[str, Any]) -> Self:
        """The value with all these members, which it keeps; nothing is checked.

        For the many values that our own code makes. `model_construct` sets the same attributes,
        but takes ten times as long, because it looks for defaults and aliases.
        """
        value = cls.__new__(cls)
        _set(value, "__dict__", members)
        _set(value, "__pydantic_fields_set__", _names_of(cls))
        _set(value, "__pydantic_extra__", None)
        _set(value, "__pydantic_private__", None)
        return value

    @classmethod
    def read(cls, raw: bytes | str) -> Self:
        """The value in this JSON; fields that this version does not know are ignored."""
        return cls.model_validate_json(raw, extra="ignore")


class WireModel(JsonModel):
    """A `JsonModel` between Skyway's own processes: fields of a newer writer are ignored."""

    model_config = ConfigDict(extra="ignore")


class QueryModel(JsonModel):
    """The query of a call, whose values all come as text: `5` is read as a number."""

    takes_text = True


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
