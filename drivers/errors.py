"""What can go wrong between us and a device.

DriverError
├── PortError            the port itself, before any device was asked
│   ├── PortMissingError     nothing is plugged in there
│   ├── PortDeniedError      no permission
│   └── PortBusyError        another program holds it
├── NoAnswerError        the port is open and nothing (right) came back in time
├── ProtocolError        the device answered what its protocol does not allow
├── DeviceFaultError     the device says itself that it cannot: protection stop, firmware too old
├── DeviceLostError      it answered before and is gone: cable, power, reset
└── NotArmedError        a command that could move the car, without leave to do so
"""

from __future__ import annotations

from dialogue import TracksideError


class DriverError(TracksideError):
    """Root of this room's errors; the text names the device, its port, and what to do."""


class PortError(DriverError, OSError):
    """A port that cannot be opened."""


class PortMissingError(PortError):
    """There is no such port: unplugged, another number after a re-plug, a driver not loaded."""


class PortDeniedError(PortError):
    """The user may not open the port."""


class PortBusyError(PortError):
    """Another program, or another thread of ours, holds the port."""


class NoAnswerError(DriverError, TimeoutError):
    """The device stayed silent, or said nothing that its protocol knows, until the deadline."""


class ProtocolError(DriverError):
    """An answer that the protocol does not allow; the text holds its bytes."""


class DeviceFaultError(DriverError):
    """The device reports a fault of its own, or its firmware cannot do what is asked."""


class DeviceLostError(DriverError, ConnectionError):
    """A device that answered before and does not any more."""


class NotArmedError(DriverError):
    """A command that could move the car while the controller is not armed."""
