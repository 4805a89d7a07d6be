"""The devices of the car and of the track: bytes in, samples out, and their emulators.

Each device has a folder: `protocol` (pure: bytes <-> messages), `driver` (port and conversation)
and `emulator` (the device's own side). A driver is synchronous; `DeviceReader` gives it a thread.
Nothing here knows files or sessions. Libraries (pyserial, smbus2, linuxpy, cv2) are imported when a
port is opened, not before.
"""

from drivers.device import Counters, Device, Reading, Tick
from drivers.emulation import DeviceModel, Line, ModelPort, PtyEmulator
from drivers.errors import (
    DeviceFaultError,
    DeviceLostError,
    DriverError,
    NoAnswerError,
    NotArmedError,
    PortBusyError,
    PortDeniedError,
    PortError,
    PortMissingError,
    ProtocolError,
)
from drivers.port import Chunk, Port, SerialPort, drain
from drivers.reader import DeviceBack, DeviceLost, DeviceReader

__all__ = [
    "Chunk",
    "Counters",
    "Device",
    "DeviceBack",
    "DeviceFaultError",
    "DeviceLost",
    "DeviceLostError",
    "DeviceModel",
    "DeviceReader",
    "DriverError",
    "Line",
    "ModelPort",
    "NoAnswerError",
    "NotArmedError",
    "Port",
    "PortBusyError",
    "PortDeniedError",
    "PortError",
    "PortMissingError",
    "ProtocolError",
    "PtyEmulator",
    "Reading",
    "SerialPort",
    "Tick",
    "drain",
]
