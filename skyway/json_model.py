"""The base of all models with a JSON form: frozen, and strict about unknown fields."""

from typing import Self

from pydantic import BaseModel, ConfigDict


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
    def read(cls, raw: bytes | str) -> Self:
        """The value in this JSON; fields that this version does not know are ignored."""
        return cls.model_validate_json(raw, extra="ignore")


class WireModel(JsonModel):
    """A `JsonModel` between Skyway's own processes: fields of a newer writer are ignored."""

    model_config = ConfigDict(extra="ignore")
