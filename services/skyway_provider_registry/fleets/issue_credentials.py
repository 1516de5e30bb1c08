"""Issues a drone's credentials: the first by a token, the next ones by a rotation."""

import secrets
from collections.abc import Iterable
from datetime import datetime, timedelta
from typing import Annotated, Final

from pydantic import Field

from skyway.bounds import Moment
from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.passwords import PasswordHash
from skyway.contracts.broker_rules import drone_account
from skyway.contracts.drones import DRONE_KEY_PREFIX
from skyway.contracts.message import Soc
from skyway.contracts.signature import CloudKeys
from skyway.drone.model import DroneModel
from skyway.geo import Position
from skyway.ids import DroneId, ProviderId, StationId
from skyway.json_model import JsonModel
from skyway.runtime.errors import AccessDenied
from skyway.runtime.peer_secrets import secret_hash
from skyway.runtime.signing.cloud_key_file import CloudKeyFile
from skyway.runtime.sql.database import Tx
from skyway_provider_registry import change_store
from skyway_provider_registry.change_store import RenewalMoment
from skyway_provider_registry.enrolment import credential_store, signing_store
from skyway_provider_registry.enrolment.signing_store import SigningKey
from skyway_provider_registry.fleets import store
from skyway_provider_registry.fleets.drone import MqttAccount
from skyway_provider_registry.presence import store as presence

#: Characters.
_LONGEST_TOKEN: Final = 200

_ENROLMENT_PREFIX: Final = "enr_"
#: 256 bits: nobody guesses such a secret, so a fast hash is safe enough.
_SECRET_BYTES: Final = 32

#: How long an enrolment token can be exchanged, wall time.
TOKEN_LIFE: Final = timedelta(days=30)


class EnrolmentRequest(JsonModel):
    """The body of POST /v1/enrolments."""

    enrolment_token: Annotated[
        str,
        Field(
            min_length=1,
            max_length=_LONGEST_TOKEN,
            repr=False,
            description="the token that the drone's registration showed",
            examples=["enr_3q2-7w"],
        ),
    ]
    public_key: SigningKey = None


class RotationRequest(JsonModel):
    """The body of POST /v1/enrolments/rotations."""

    public_key: SigningKey = None


class IssuedToken(JsonModel):
    """A new enrolment token."""

    drone_id: Annotated[DroneId, Field(description="the drone that may enrol with it")]
    enrolment_token: Annotated[
        str, Field(repr=False, description="the token; it is shown only once")
    ]
    expires_wall_at: Annotated[
        Moment, Field(description="until when it can be exchanged, wall time")
    ]


class ClientCertificate(JsonModel):
    """A client certificate, for a broker that requires more than a password."""

    certificate_pem: Annotated[str, Field(description="the drone's certificate, PEM")]
    private_key_pem: Annotated[str, Field(repr=False, description="its private key, PEM")]
    ca_pem: Annotated[
        str, Field(description="certificate of the authority that the drone trusts, PEM")
    ]


class Credentials(JsonModel):
    """A broker account, and a key for the drone's own REST calls; both are shown only once."""

    mqtt: Annotated[MqttAccount, Field(description="account at the broker")]
    mqtt_urls: Annotated[
        tuple[str, ...],
        Field(description="addresses of the broker's nodes; empty if the operator names none"),
    ]
    certificate: Annotated[
        ClientCertificate | None,
        Field(description="null where the deployment has no authority for drones"),
    ]
    key: Annotated[
        str, Field(repr=False, description="bearer token for the drone's own REST calls")
    ]
    cloud_keys: Annotated[
        CloudKeys, Field(description="keys by which the drone knows the cloud's messages")
    ]


class Enrolment(Credentials):
    """Everything that a drone needs to start: its identity, its position and its credentials."""

    drone_id: Annotated[DroneId, Field(description="id of the drone")]
    provider_id: Annotated[ProviderId, Field(description="id of its provider")]
    model: Annotated[DroneModel, Field(description="its drone model with all limits")]
    home_station_id: Annotated[StationId, Field(description="id of its home station")]
    home_position: Annotated[
        Position, Field(description="longitude and latitude of the home station, degrees")
    ]
    station_id: Annotated[
        StationId | None, Field(description="the station where it last stood; null if unknown")
    ]
    position: Annotated[
        Position | None, Field(description="its last longitude and latitude; null if unknown")
    ]
    soc: Annotated[Soc, Field(description="its last state of charge, 0 to 1")]


class Issuer:
    """Makes credentials; with an authority they include a certificate.

    `hash_password` makes of a broker password what is stored. `mqtt_urls` are the addresses of the
    broker at which drones connect.
    """

    def __init__(
        self,
        authority: CertificateAuthority | None,
        cloud_keys: CloudKeyFile,
        hash_password: PasswordHash,
        *,
        mqtt_urls: tuple[str, ...] = (),
    ) -> None:
        self.hash_password = hash_password
        self._mqtt_urls = mqtt_urls
        self._authority = authority
        self._cloud_keys = cloud_keys

    def make(self, provider_id: ProviderId, drone_id: DroneId) -> Credentials:
        """New credentials, not stored yet; this only computes."""
        user_name, key = drone_account(provider_id, drone_id), _new_key()
        return Credentials(
            mqtt=MqttAccount(user_name=user_name, password=_new_password()),
            mqtt_urls=self._mqtt_urls,
            certificate=self._certificate(user_name, secret_hash(key)),
            key=key,
            cloud_keys=self._cloud_keys.read(),
        )

    def _certificate(self, user_name: str, key_hash: str) -> ClientCertificate | None:
        if self._authority is None:
            return None
        signed = self._authority.sign_drone(user_name, key_hash=key_hash)
        return ClientCertificate(
            certificate_pem=signed.certificate_pem,
            private_key_pem=signed.private_key_pem,
            ca_pem=self._authority.certificate_pem,
        )


async def issue_token(tx: Tx, drone_id: DroneId, *, wall_now: datetime) -> IssuedToken:
    """A new token for a drone; it replaces the old token, and the credentials stay valid."""
    token, expires_wall_at = new_token(), wall_now + TOKEN_LIFE
    await credential_store.put_token(
        tx, drone_id, token_hash=secret_hash(token), expires_at=expires_wall_at
    )
    return IssuedToken(drone_id=drone_id, enrolment_token=token, expires_wall_at=expires_wall_at)


async def enrol(
    tx: Tx, requested: EnrolmentRequest, *, issuer: Issuer, moment: RenewalMoment
) -> Enrolment:
    """Exchange a token for credentials; the drone's earlier credentials stop working.

    Raises
    ------
    InvalidInput
        The drone has signed its messages before, and gives no public key.
    AccessDenied
        No drone has this token.
    Conflict
        The token was used before or is too old.
    """
    token = secret_hash(requested.enrolment_token)
    drone_id = await credential_store.use_token(tx, token, at=moment.wall_at)
    drone = (await store.by_id(tx.connection, drone_id)).shown(moment.wall_at)
    made = issuer.make(drone.provider_id, drone_id)
    await credential_store.set_password(
        tx, drone_id, password_hash=issuer.hash_password(made.mqtt.password)
    )
    await credential_store.put_key(tx, drone_id, key_hash=secret_hash(made.key), at=moment.wall_at)
    await signing_store.put_key(tx, drone_id, requested.public_key)
    await change_store.note(tx, drone_id, moment)
    return Enrolment(
        drone_id=drone_id,
        provider_id=drone.provider_id,
        model=drone.model,
        home_station_id=drone.home_station_id,
        home_position=drone.home_position,
        station_id=drone.station_id,
        position=drone.position,
        soc=drone.soc,
        mqtt=made.mqtt,
        mqtt_urls=made.mqtt_urls,
        certificate=made.certificate,
        key=made.key,
        cloud_keys=made.cloud_keys,
    )


async def rotate(
    tx: Tx, drone_id: DroneId, requested: RotationRequest, *, issuer: Issuer, wall_now: datetime
) -> Credentials:
    """The next credentials; they replace the present ones when the drone first uses the new key.

    Raises
    ------
    InvalidInput
        The drone has signed its messages before, and gives no public key.
    AccessDenied
        The drone's credentials were revoked in the meantime.
    """
    drone = await store.by_id(tx.connection, drone_id)
    made = issuer.make(drone.provider_id, drone_id)
    has_key = await credential_store.put_next_key(
        tx,
        drone_id,
        key_hash=secret_hash(made.key),
        password_hash=issuer.hash_password(made.mqtt.password),
        at=wall_now,
    )
    if not has_key:
        raise AccessDenied(f"drone {drone_id} has no credentials to rotate")
    await signing_store.put_next_key(tx, drone_id, requested.public_key)
    return made


async def revoke(tx: Tx, drone_id: DroneId, moment: RenewalMoment) -> None:
    """Stop the drone's account, key and token, and count the drone as lost."""
    await presence.cut_off(tx, drone_id)
    await change_store.note(tx, drone_id, moment)
    await credential_store.block_account(tx, drone_id, at=moment.wall_at)
    await credential_store.remove_keys(tx, drone_id, at=moment.wall_at)
    await credential_store.remove_token(tx, drone_id)
    await signing_store.revoke(tx, drone_id)


def _new_password() -> str:
    """A random broker password."""
    return secrets.token_urlsafe(_SECRET_BYTES)


def new_passwords(
    drone_ids: Iterable[DroneId], hash_password: PasswordHash
) -> tuple[dict[DroneId, str], dict[DroneId, str]]:
    """A random broker password for each drone, and its hash; 5,000 take 0.3 s, for NATS 5 s."""
    passwords = {drone_id: _new_password() for drone_id in drone_ids}
    return passwords, {drone: hash_password(password) for drone, password in passwords.items()}


def _new_key() -> str:
    """A new key, which the drone shows when it calls REST."""
    return DRONE_KEY_PREFIX + secrets.token_urlsafe(_SECRET_BYTES)


def new_token() -> str:
    """A new enrolment token."""
    return _ENROLMENT_PREFIX + secrets.token_urlsafe(_SECRET_BYTES)
