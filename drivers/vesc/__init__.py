"""The VESC motor controller (4.12 and later): read by anybody, driven by whoever has armed it.

`framing`, `firmware`, `requests`, `commands`, `values`, `setup_values` and `odometry` are pure:
bytes, values, poses. `Vesc` reads and can send nothing but questions; `VescController` reads and
may drive, within `with controller.arm(DriveLimits(...)) as drive`. `emulated_vesc` is the device's
side, with a motor that obeys or with recorded replies.
"""

from drivers.vesc.commands import Command, encode_command
from drivers.vesc.controller import VescController
from drivers.vesc.drive import Drive, DriveCommand
from drivers.vesc.driver import Vesc, VescConfig
from drivers.vesc.emulated_motor import (
    DrivenMotor,
    Motor,
    RecordedReplies,
    SourceMotor,
    counter_reading,
)
from drivers.vesc.emulator import VescFaults, VescModel, emulated_vesc
from drivers.vesc.faults import fault_name
from drivers.vesc.firmware import Firmware, parse_firmware
from drivers.vesc.framing import FrameReceiver, encode_frame
from drivers.vesc.limits import DriveLimits
from drivers.vesc.odometry import VescCalibration, VescOdometry, advance_odometry, begin_odometry
from drivers.vesc.requests import ASK_SETUP, ASK_VALUES, ODOMETRY_MASK, ReadId, ReadRequest
from drivers.vesc.setup_values import VescImu, VescSetupValues, decode_imu, decode_setup
from drivers.vesc.values import VescValues, decode_values

__all__ = [
    "ASK_SETUP",
    "ASK_VALUES",
    "ODOMETRY_MASK",
    "Command",
    "Drive",
    "DriveCommand",
    "DriveLimits",
    "DrivenMotor",
    "Firmware",
    "FrameReceiver",
    "Motor",
    "ReadId",
    "ReadRequest",
    "RecordedReplies",
    "SourceMotor",
    "Vesc",
    "VescCalibration",
    "VescConfig",
    "VescController",
    "VescFaults",
    "VescImu",
    "VescModel",
    "VescOdometry",
    "VescSetupValues",
    "VescValues",
    "advance_odometry",
    "begin_odometry",
    "counter_reading",
    "decode_imu",
    "decode_setup",
    "decode_values",
    "emulated_vesc",
    "encode_command",
    "encode_frame",
    "fault_name",
    "parse_firmware",
]
