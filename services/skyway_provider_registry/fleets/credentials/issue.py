"""Issues a drone's credentials: the first by a token, the next ones by a rotation."""

from datetime import datetime

from skyway.broker_setup.certificates import CertificateAuthority
from skyway.broker_setup.passwords import hash_password
from skyway.ids import DroneId
from skyway.runtime.errors import AccessDenied
from skyway.runtime.sql.database import Tx
from skyway_provider_registry.enrolment import account_store as accounts
from skyway_provider_registry.enrolment import drone_key_store as drone_keys
from skyway_provider_registry.enrolment import token_store as tokens
from skyway_provider_registry.enrolment.drone_secrets import (
    TOKEN_LIFE,
    key_hash,
    new_key,
    new_password,
    new_token,
    token_hash,
)
from skyway_provider_registry.fleets import store
from skyway_provider_registry.fleets.credentials.credentials import (
    ClientCertificate,
    Credentials,
    Enrolment,
    IssuedToken,
)
from skyway_provider_registry.fleets.drone import MqttAccount
from skyway_provider_registry.presence import store as presence


class Issuer:
    """Makes credentials; with an authority they include a certificate."""

    def __init__(self, authority: CertificateAuthority | None) -> None:
        self._authority = authority

    def make(self, drone_id: DroneId) -> Credentials:
        """New credentials, not stored yet; this only computes."""
        return Credentials(
            mqtt=MqttAccount(user_name=drone_id, password=new_password()),
            certificate=self._certificate(drone_id),
            key=new_key(),
        )

    def _certificate(self, drone_id: DroneId) -> ClientCertificate | None:
        if self._authority is None:
            return None
        signed = self._authority.sign_drone(drone_id)
        return ClientCertificate(
            certificate_pem=signed.certificate_pem,
            private_key_pem=signed.private_key_pem,
            ca_pem=self._authority.certificate_pem,
        )


async def issue_token(tx: Tx, drone_id: DroneId, *, wall_now: datetime) -> IssuedToken:
    """A new token for a drone; it replaces the old token, and the credentials stay valid."""
    token, expires_at = new_token(), wall_now + TOKEN_LIFE
    await tokens.put(tx, drone_id, token_hash=token_hash(token), expires_at=expires_at)
    return IssuedToken(drone_id=drone_id, enrolment_token=token, expires_at=expires_at)


async def enrol(tx: Tx, token: str, *, issuer: Issuer, wall_now: datetime) -> Enrolment:
    """Exchange a token for credentials; the drone's earlier credentials stop working.

    Raises
    ------
    AccessDenied
        No drone has this token.
    Conflict
        The token was used before or is too old.
    """
    drone_id = await tokens.use(tx, token_hash(token), at=wall_now)
    drone = (await store.by_id(tx.connection, drone_id)).shown(wall_now)
    made = issuer.make(drone_id)
    await accounts.set_password(tx, drone_id, password_hash=hash_password(made.mqtt.password))
    await drone_keys.put(tx, drone_id, key_hash=key_hash(made.key))
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
        certificate=made.certificate,
        key=made.key,
    )


async def rotate(tx: Tx, drone_id: DroneId, *, issuer: Issuer) -> Credentials:
    """The next credentials; they replace the present ones when the drone first uses the new key.

    Raises
    ------
    AccessDenied
        The drone's credentials were revoked in the meantime.
    """
    made = issuer.make(drone_id)
    has_key = await drone_keys.put_next(
        tx,
        drone_id,
        key_hash=key_hash(made.key),
        password_hash=hash_password(made.mqtt.password),
    )
    if not has_key:
        raise AccessDenied(f"drone {drone_id} has no credentials to rotate")
    return made


async def revoke(tx: Tx, drone_id: DroneId, *, wall_now: datetime) -> None:
    """Stop the drone's account, key and token, and count the drone as lost."""
    await presence.cut_off(tx, drone_id)
    await accounts.revoke(tx, drone_id, at=wall_now)
    await drone_keys.remove(tx, drone_id)
    await tokens.remove(tx, drone_id)
