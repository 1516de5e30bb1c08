"""The address of a drone's autopilot, and how the drone drops its packages."""

import math
from dataclasses import dataclass
from typing import Any, Final, Self

from skyway.runtime.errors import InvalidSettings

#: Pulse widths that servos understand, microseconds.
_PULSES_US: Final = (500, 2_500)


@dataclass(frozen=True, slots=True)
class PayloadRelease:
    """A gripper that opens, or a servo that turns to a pulse width in microseconds.

    The same command drops the next packages: the drone has one dispenser, not one actuator for each
    package.
    """

    instance: int
    pulse_us: int | None = None

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``gripper:1`` or ``servo:9:1900``."""
        parts = text.split(":")
        numbers = [int(part) for part in parts[1:] if part.isdecimal()]
        least_us, most_us = _PULSES_US
        match parts[0], numbers:
            case "gripper", [instance] if len(parts) == 2 and instance >= 1:
                return cls(instance)
            case "servo", [instance, pulse_us] if len(parts) == 3 and instance >= 1:
                if least_us <= pulse_us <= most_us:
                    return cls(instance, pulse_us)
        raise InvalidSettings(
            f"a payload is gripper:NUMBER or servo:NUMBER:MICROSECONDS ({least_us} to {most_us}), "
            f"not {text!r}"
        )

    def command(self, dialect: Any) -> tuple[float, ...]:  # pymavlink's numbers
        """The id and the parameters of the command that drops the packages."""
        if self.pulse_us is None:
            return (
                dialect.MAV_CMD_DO_GRIPPER,
                self.instance,
                dialect.GRIPPER_ACTION_RELEASE,
            )
        return dialect.MAV_CMD_DO_SET_SERVO, self.instance, self.pulse_us


@dataclass(frozen=True, slots=True)
class MavlinkSettings:
    """The address of the autopilot, and how its drone is used.

    A release that is not answered for `release_s` of wall time may have been done, or not.
    Without `system_id` the first autopilot that sends is the drone's.
    """

    address: str
    payload: PayloadRelease
    altitude_m: float
    release_s: float = 10.0
    system_id: int | None = None

    def __post_init__(self) -> None:
        if not 1.0 <= self.altitude_m <= 500.0 or math.isnan(self.altitude_m):
            raise InvalidSettings(f"--altitude-m is 1 to 500, not {self.altitude_m:g}")
        if self.system_id is not None and not 1 <= self.system_id <= 255:
            raise InvalidSettings(f"--system-id is 1 to 255, not {self.system_id}")
