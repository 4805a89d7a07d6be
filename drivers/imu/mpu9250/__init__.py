"""The MPU-9250 (and 9255, 6500) with its AK8963 on an I2C bus, emptied through its FIFO.

`protocol` reads what came over the bus, live and from a raw log; `start` sets the chip up and reads
every setting back; `driver` polls; `emulator` is a bus with a chip on it, down to the registers.
"""

from drivers.imu.mpu9250.bus import Bus, SmbusBus
from drivers.imu.mpu9250.driver import Mpu9250
from drivers.imu.mpu9250.emulator import FakeMpu9250Bus, RealTimeMpu9250Bus
from drivers.imu.mpu9250.protocol import Mpu9250Decoder
from drivers.imu.mpu9250.self_test import SelfTest
from drivers.imu.mpu9250.start import Mpu9250Config

__all__ = [
    "Bus",
    "FakeMpu9250Bus",
    "Mpu9250",
    "Mpu9250Config",
    "Mpu9250Decoder",
    "RealTimeMpu9250Bus",
    "SelfTest",
    "SmbusBus",
]
