"""API keys as operators and their holders see them."""

from datetime import datetime, timedelta
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, Field, computed_field, model_validator

from skyway.bounds import Moment
from skyway.errors import InvalidInput
from skyway.ids import TEST_PREFIX, KeyId, ProviderId, SubjectId, is_live_account
from skyway.json_model import JsonModel
from skyway.runtime.errors import AccessDenied
from skyway.runtime.http.identity import KeyHolder
from skyway.units import moment_to_ms
from skyway_gateway.access.scopes import SCOPES, Scope

KeyRole = Literal["customer", "provider", "operator"]

#: The longest life of a key that has an expiry: ten years with their leap days.
LONGEST_LIFE: Final = timedelta(days=3653)

#: The most characters of a name.
_LONGEST_NAME: Final = 100


def _one_printable_line(name: str) -> str:
    if not name.isprintable():
        raise ValueError("must hold printable characters only")
    return name


def _each_once(scopes: tuple[Scope, ...]) -> tuple[Scope, ...]:
    return tuple(sorted(set(scopes)))


KeyName = Annotated[
    str, Field(min_length=1, max_length=_LONGEST_NAME), AfterValidator(_one_printable_line)
]
KeyScopes = Annotated[
    tuple[Scope, ...], Field(min_length=1, max_length=len(SCOPES)), AfterValidator(_each_once)
]


class NewKey(JsonModel):
    """The key that is issued: its role, the subject that it is for, and what limits it."""

    role: KeyRole
    subject_id: SubjectId
    name: KeyName | None = None
    scopes: KeyScopes | None = None
    expires_wall_at: Moment | None = None

    @classmethod
    def of_provider(cls, provider_id: ProviderId, maker: KeyHolder) -> Self:
        """The first key of a new provider, with the scopes and the expiry of its maker's key."""
        scopes = None if maker.scopes is None else tuple(sorted(maker.scopes))
        limits = {"scopes": scopes, "expires_wall_at": maker.expires_at}
        return cls.model_validate({"role": "provider", "subject_id": provider_id, **limits})

    def refuse_unless_within(self, holder: KeyHolder) -> None:
        """Go on only if the key has no more scopes and no later end than the holder's own key.

        Raises
        ------
        AccessDenied
            It has more scopes, or a later end.
        """
        if holder.scopes is not None and not set(self.scopes or SCOPES) <= holder.scopes:
            raise AccessDenied(
                "scopes: a key can give only scopes of its own: " + ", ".join(sorted(holder.scopes))
            )
        ends_at = holder.expires_at
        if ends_at is not None and (
            self.expires_wall_at is None
            or moment_to_ms(self.expires_wall_at) > moment_to_ms(ends_at)
        ):
            raise AccessDenied(
                f"expires_wall_at: a key can give no later end than its own, {ends_at.isoformat()}"
            )

    def refuse_bad_end(self, now: datetime) -> None:
        """Go on only if the key ends in the future, and within ten years; `now` is wall time.

        Raises
        ------
        InvalidInput
            It ends in the past, or too late.
        """
        if self.expires_wall_at is None:
            return
        if moment_to_ms(self.expires_wall_at) <= moment_to_ms(now):
            raise InvalidInput(
                "expires_wall_at", f"must be in the future: now is {now.isoformat()}"
            )
        latest = now + LONGEST_LIFE
        if self.expires_wall_at > latest:
            raise InvalidInput(
                "expires_wall_at", f"must be within ten years, not after {latest.isoformat()}"
            )


#: The longest name of a customer that may have a test account.
_LONGEST_WITH_TEST: Final = 64 - len(TEST_PREFIX)


class KeyRequest(JsonModel):
    """The key that is asked for; customers may ask for keys of their own test account only."""

    livemode: Annotated[
        bool,
        Field(
            description="False for a key of a customer's test account, `test_` and the customer's "
            "name, which sees the sandbox only."
        ),
    ] = True
    role: Annotated[
        KeyRole | None, Field(description="Who the key is for; customers leave it out.")
    ] = None
    subject_id: Annotated[
        SubjectId | None,
        Field(
            description="A customer's own name, a provider's id, or an operator's name; with "
            "`livemode` false, the customer whose test account it is. Customers leave it out."
        ),
    ] = None
    name: Annotated[
        KeyName | None,
        Field(description="What people call the key: printable characters.", examples=["laptop"]),
    ] = None
    scopes: Annotated[
        KeyScopes | None,
        Field(
            description="Which calls of the role it allows; without this, all of them.",
            examples=[["deliveries:read"]],
        ),
    ] = None
    expires_wall_at: Annotated[
        Moment | None,
        Field(description="When it ends, wall time, at most ten years ahead; without this, never."),
    ] = None

    def asked_by(self, caller_role: str, caller_id: str) -> NewKey:
        """The key that this caller asks for.

        Raises
        ------
        InvalidInput
            The role or the subject is missing, or cannot have a test account; or a customer asks
            for a live key, or for a key of somebody else.
        """
        role, subject_id = self.role, self.subject_id
        if caller_role == "customer":
            own = SubjectId(caller_id)
            wrong = {
                "livemode": self.livemode,
                "role": role not in (None, "customer"),
                "subject_id": subject_id not in (None, own),
            }
            for field in (name for name, is_wrong in wrong.items() if is_wrong):
                raise InvalidInput(field, "customers make keys of their own test account only")
            role, subject_id = "customer", own
        if role is None or subject_id is None:
            field = "role" if role is None else "subject_id"
            raise InvalidInput(field, "must be given")
        if not is_live_account(subject_id):
            detail = f"must not begin with {TEST_PREFIX!r}: set livemode to false for a test key"
            raise InvalidInput("subject_id", detail)
        if not self.livemode:
            subject_id = _test_account_of(role, subject_id)
        limits = {"name": self.name, "scopes": self.scopes, "expires_wall_at": self.expires_wall_at}
        return NewKey.model_validate({"role": role, "subject_id": subject_id, **limits})


def _test_account_of(role: KeyRole, subject_id: SubjectId) -> SubjectId:
    if role != "customer":
        raise InvalidInput("livemode", f"only customers have test accounts, and role is {role}")
    if len(subject_id) > _LONGEST_WITH_TEST:
        detail = f"{len(subject_id)} characters exceed the {_LONGEST_WITH_TEST} of a customer"
        raise InvalidInput("subject_id", f"{detail} with a test account")
    return SubjectId(TEST_PREFIX + subject_id)


class ApiKey(JsonModel):
    """A key, without its secret."""

    key_id: Annotated[KeyId, Field(description="The id of the key, which is not secret.")]
    role: Annotated[KeyRole, Field(description="Who the key is for.")]
    subject_id: Annotated[
        SubjectId,
        Field(description="The customer's name, the provider's id or the operator's name."),
    ]
    name: Annotated[str | None, Field(description="What people call it; null without a name.")] = (
        None
    )
    scopes: Annotated[
        tuple[Scope, ...] | None,
        Field(description="Which calls of the role it allows; null for all of them."),
    ] = None
    created_wall_at: Annotated[Moment, Field(description="RFC 3339 UTC, wall time")]
    expires_wall_at: Annotated[
        Moment | None,
        Field(
            description="When it ends, wall time; null for never. A key that was rotated ends "
            "within a day."
        ),
    ] = None
    replaces: Annotated[
        KeyId | None,
        Field(
            description="The key from which it was rotated, and which ends when this one is first "
            "used; null for a key that was made."
        ),
    ] = None

    @computed_field(  # type: ignore[prop-decorator]
        description="False for a key of a test account, which sees the sandbox only."
    )
    @property
    def livemode(self) -> bool:
        """Whether the calls of the key are real."""
        return is_live_account(self.subject_id)


class BrokerLogin(JsonModel):
    """A broker account; each new key of its holder gives the same account a new password.

    The account ends when the key ends that gave it its present password.
    """

    user_name: Annotated[str, Field(description="The user name at the broker.")]
    password: Annotated[
        str, Field(description="The password; a later key of the same holder replaces it.")
    ]


class IssuedKey(ApiKey):
    """A new key with its secrets, which are shown only once."""

    @model_validator(mode="before")
    @classmethod
    def _without_computed(cls, values: dict[str, object]) -> dict[str, object]:
        # A stored answer is read again.
        return {name: value for name, value in values.items() if name != "livemode"}

    key: Annotated[
        str, Field(description="The secret key for `Authorization: Bearer`; it is shown only once.")
    ]
    mqtt: Annotated[
        BrokerLogin | None,
        Field(
            description="The broker account with its new password; null for providers, for test "
            "accounts, for a customer's key without the scope `deliveries:read`, for an operator's "
            "key with scopes, and after a rotation while another key's password is valid."
        ),
    ]
