"""What a VESC's FW_VERSION reply tells, and the packet ids that its version decides.

At firmware 3.7 the ids moved by one. 12 sets the servo of a new VESC and overwrites the motor
configuration of an old one; 29 is ALIVE to an old one and reboots a new one. So nothing that could
do harm can be encoded without a `Firmware`, and that is made from a reply. (reference B.3, B.5)
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.errors import DeviceFaultError, ProtocolError

FW_VERSION = 0

FIRST_KNOWN, LAST_OLD = (2, 10), (3, 0)
FIRST_NEW, FIRST_UNKNOWN = (3, 7), (7, 0)
UUID_BYTES = 12


@dataclass(frozen=True)
class CommandIds:
    """The packet ids that are not the same in every firmware; None: it has no such command."""

    servo: int
    alive: int
    handbrake: int | None


_OLD_IDS = CommandIds(servo=11, alive=29, handbrake=None)
_NEW_IDS = CommandIds(servo=12, alive=30, handbrake=10)


@dataclass(frozen=True)
class Firmware:
    """A VESC as its FW_VERSION reply describes it; make it with `parse_firmware`.

    hardware : `410` for boards 4.10 to 4.12; uuid : of the processor, hexadecimal; both empty in
    firmware that does not tell. paired, beta : None in firmware that does not tell.
    """

    major: int
    minor: int
    hardware: str = ""
    uuid: str = ""
    paired: bool | None = None
    beta: int | None = None

    @property
    def version(self) -> tuple[int, int]:
        """For comparing: 3.7 is (3, 7) and older than 3.40."""
        return self.major, self.minor

    def __str__(self) -> str:
        """As VESC Tool writes it: `5.02`."""
        return f"{self.major}.{self.minor:02d}"

    @property
    def is_old(self) -> bool:
        """Whether it is of the time before the ids moved."""
        return self.version <= LAST_OLD

    def command_ids(self) -> CommandIds:
        """The ids for commanding it. Raises `DeviceFaultError` for a version nobody looked at."""
        if FIRST_KNOWN <= self.version <= LAST_OLD:
            return _OLD_IDS
        if FIRST_NEW <= self.version < FIRST_UNKNOWN:
            return _NEW_IDS
        raise DeviceFaultError(
            f"VESC firmware {self} is not one whose packet ids are known (2.10 to 3.00, 3.07 to "
            "6.x): the servo's id could be that of SET_MCCONF or REBOOT, so it will not be "
            "commanded; install a known firmware with VESC Tool"
        )


def parse_firmware(payload: bytes) -> Firmware:
    """What a FW_VERSION reply holds, as far as this firmware tells. Raises `ProtocolError`."""
    if len(payload) < 3 or payload[0] != FW_VERSION:
        raise ProtocolError(
            f"this is no FW_VERSION reply of a VESC: {payload.hex(' ')} "
            "(expected 00, major, minor, ...)"
        )
    major, minor, rest = payload[1], payload[2], payload[3:]
    name, end, rest = rest.partition(b"\0")
    hardware = name.decode("ascii", errors="replace") if end else ""
    uuid = rest[:UUID_BYTES].hex() if len(rest) >= UUID_BYTES else ""
    flags = rest[UUID_BYTES:]
    return Firmware(
        major,
        minor,
        hardware,
        uuid,
        paired=bool(flags[0]) if flags else None,
        beta=flags[1] if len(flags) > 1 else None,
    )
