"""The stream of the Razor AHRS firmware, in our axes. Pure.

Its frame is x forward, y right, z down and its acceleration is that of gravity (reference protocols
C.3 and the ROS node of Kristof Robot); ours is x forward, y left, z up.
"""

from __future__ import annotations

import math
from dataclasses import replace

from drivers.device import Counters, Reading, Tick
from drivers.imu.razor.lines import NO_SENSOR, Frame, LineReader, frame_of
from drivers.imu.sample import STANDARD_GRAVITY_M_S2, ImuSample, Vector, quaternion_wxyz
from drivers.port import Chunk

COUNTS_PER_G = 256.0
ITG3200_RAD_S_PER_COUNT = math.radians(0.06957)
"""The gyro of the boards that the original firmware knows; the fork prints rad/s (with #YPRAG)."""

KNOWN_TAGS = {"YPR": 3, "YPRAG": 9, "A-C": 3, "M-C": 3, "G-C": 3, "A-R": 3, "M-R": 3, "G-R": 3}


class AhrsDecoder:
    """Chunks in, samples and ticks out.

    The firmware tells no time, so a sample's device_ns is its arrival here less the bytes that came
    after it, and the ticks tie that to itself. A line on the wire takes `line_baud`; None: USB.
    Samples come from #YPRAG lines, or from #A-C with the #G-C after it; `!ERR` lines are counted.
    """

    def __init__(self, counters: Counters, line_baud: int | None = None) -> None:
        self.counters = counters
        self._lines = LineReader(counters)
        self._byte_ns = 0 if line_baud is None else 10_000_000_000 // line_baud
        self._accel: Vector | None = None

    def feed(self, chunk: Chunk) -> Reading[ImuSample]:
        """What these bytes complete."""
        samples: list[ImuSample] = []
        ticks: list[Tick] = []
        for line in self._lines.feed(chunk.data):
            frame = frame_of(line.text)
            if frame is None or KNOWN_TAGS.get(frame.tag) != len(frame.values):
                self._count_other(line.text)
                continue
            sample = self._sample(frame)
            if sample is None:
                continue
            end_ns = chunk.t_ns - line.following * self._byte_ns
            samples.append(replace(sample, device_ns=end_ns))
            ticks.append(Tick(end_ns, end_ns, (len(line.text) + 2) * self._byte_ns))
        self.counters.samples += len(samples)
        return Reading((chunk,), tuple(ticks), tuple(samples))

    def _sample(self, frame: Frame) -> ImuSample | None:
        if frame.tag == "YPRAG":
            return sample_of_yprag(frame.values)
        if frame.tag == "A-C":
            self._accel = acceleration(frame.values)
        if frame.tag == "G-C" and self._accel is not None:
            accel, self._accel = self._accel, None
            x, y, z = (value * ITG3200_RAD_S_PER_COUNT for value in frame.values)
            return ImuSample(0, (x, -y, -z), accel)
        return None

    def _count_other(self, text: bytes) -> None:
        if text.startswith(b"!ERR"):
            details = self.counters.details
            details["sensor_errors"] = details.get("sensor_errors", 0) + 1
        elif not text.startswith(b"#SYNCH") and text != NO_SENSOR:
            self.counters.bad_frames += 1


def sample_of_yprag(values: tuple[float, ...]) -> ImuSample:
    """The sample in yaw, pitch, roll (deg), acceleration (256 = 1 g), gyro (rad/s); no time yet."""
    yaw, pitch, roll = (math.radians(angle) for angle in values[:3])
    gx, gy, gz = values[6:9]
    return ImuSample(
        device_ns=0,
        angular_velocity_rad_s=(gx, -gy, -gz),
        linear_acceleration_m_s2=acceleration(values[3:6]),
        orientation_wxyz=quaternion_wxyz(-yaw, -pitch, roll),
    )


def acceleration(values: tuple[float, ...]) -> Vector:
    """Metres per second squared in our axes: what it prints is negated already in y and z."""
    unit = STANDARD_GRAVITY_M_S2 / COUNTS_PER_G
    ax, ay, az = values
    return (-ax * unit, ay * unit, az * unit)
