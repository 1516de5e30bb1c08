"""What an enrolled drone keeps: who it is, and what it shows to the broker and to REST."""

from pydantic import Field

from skyway.json_model import WireModel
from skyway_drone_agent.enrolled_drone import BrokerLogin, EnrolledDrone


class Credentials(WireModel):
    """The answer to a rotation."""

    mqtt: BrokerLogin
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
        new = {"mqtt": self.following.mqtt, "key": self.following.key}
        drone = self.drone.model_copy(update=new)
        return self.model_copy(update={"drone": drone, "following": None})
