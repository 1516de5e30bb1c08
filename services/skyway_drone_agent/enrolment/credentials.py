"""What an enrolled drone keeps: who it is, and what it shows to the broker and to REST."""

from pydantic import Field

from skyway.json_model import WireModel
from skyway_drone_agent.enrolled_drone import BrokerLogin, ClientCertificate, EnrolledDrone


class Credentials(WireModel):
    """The answer to a rotation."""

    mqtt: BrokerLogin
    certificate: ClientCertificate | None = None
    key: str = Field(repr=False)


class Enrolment(EnrolledDrone):
    """The answer to an enrolment."""

    key: str = Field(repr=False)


class KeptCredentials(WireModel):
    """An enrolled drone's credentials; `following` ones may or may not have come into force.

    `token_sha256` tells which token they were exchanged for, so that the same command line, given
    again, does not ask again.
    """

    api_url: str
    token_sha256: str
    drone: Enrolment
    following: Credentials | None = None

    def followed(self) -> "KeptCredentials":
        """The same with the following credentials in the place of those they replace."""
        if self.following is None:
            return self
        new = {name: getattr(self.following, name) for name in Credentials.model_fields}
        drone = self.drone.model_copy(update=new)
        return self.model_copy(update={"drone": drone, "following": None})
