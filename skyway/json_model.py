"""The one form of everything that has a JSON form: frozen, strict about what it does not know."""

from typing import Self

from pydantic import BaseModel, ConfigDict


class JsonModel(BaseModel):
    """A frozen value with a JSON form; unknown fields, NaN and infinity are refused.

    Who reads from another Skyway process (MQTT, service to service) reads with `read`, which
    ignores fields that a newer writer may have added.
    """

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
        """The value that this JSON holds, without the fields that this version does not know."""
        return cls.model_validate_json(raw, extra="ignore")
