"""The MPU-9250 as a device: its FIFO emptied at the right moments, for whole and even samples."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping

from drivers.device import Counters, Reading
from drivers.errors import DeviceLostError, DriverError, NoAnswerError
from drivers.imu.mpu9250 import registers as reg
from drivers.imu.mpu9250.bus import Bus, SmbusBus
from drivers.imu.mpu9250.protocol import (
    Mpu9250Decoder,
    fifo_record,
    magnetometer_record,
    settings_record,
)
from drivers.imu.mpu9250.self_test import SelfTest, measure_self_test
from drivers.imu.mpu9250.start import Chip, Mpu9250Config, restart_fifo, start, stop
from drivers.imu.sample import ImuSample
from drivers.port import Chunk

POLL_NS = 15_000_000
"""About how often the FIFO is emptied; it fills in 36 ms at 1 kHz."""
SILENT_NS = 500_000_000
FAILURES = 3
"""So many failed transfers in a row are a lost device; fewer are a disturbance of the wires."""


class Mpu9250:
    """An MPU-9250, MPU-9255 or MPU-6500 on an I2C bus: a `Device[ImuSample]`.

    A sample's time is that of its angular velocity; its acceleration is older by
    `acceleration_lag_ns` (at the default filters 5.9 ms), as the two filters differ. The chip's own
    clock counts samples; it starts anew (a new epoch) when the FIFO had to be emptied unread.
    """

    def __init__(
        self,
        config: Mpu9250Config | None = None,
        open_bus: Callable[[str], Bus] = SmbusBus,
    ) -> None:
        self.config = config or Mpu9250Config()
        self.counters = Counters()
        self._open_bus = open_bus
        self._decoder = Mpu9250Decoder(self.counters)
        self._bus: Bus | None = None
        self._chip: Chip | None = None
        self._starting = self._disturbed = False
        self._next_ns = self._counted_ns = self._heard_ns = self._failures = 0

    @property
    def name(self) -> str:
        """`MPU-9250 on /dev/i2c-1`."""
        return f"MPU-9250 on {self.config.bus}"

    def connect(self) -> None:
        """Open the bus, find, reset and set the chip, start its FIFO."""
        bus = self._open_bus(self.config.bus)
        try:
            chip = start(bus, self.config)
            restart_fifo(bus, chip.address)
        except OSError as err:
            bus.close()
            if isinstance(err, DriverError):
                raise
            raise NoAnswerError(
                f"{self.name}: it answered and then failed while it was set up ({err}); check that "
                "its wires are short and firm and that the bus runs at no more than 400 kHz"
            ) from err
        except BaseException:
            bus.close()
            raise
        self._chip, self._bus = chip, bus
        self._failures, self._heard_ns = 0, bus.now_ns()
        self._note_start(bus)

    def identify(self) -> Mapping[str, object]:
        """Model, address, settings in force, and whether there is a magnetometer or why not."""
        chip = self._chip
        if chip is None:
            return {"name": self.name}
        settings = chip.settings
        why = chip.no_magnetometer_because
        return {
            "name": self.name,
            "model": reg.MODELS[settings.who_am_i],
            "who_am_i": f"0x{settings.who_am_i:02x}",
            "address": f"0x{chip.address:02x}",
            "rate_hz": settings.rate_hz,
            "gyro_range_deg_s": self.config.gyro_range_deg_s,
            "accel_range_g": self.config.accel_range_g,
            "gyro_delay_ns": settings.gyro_delay_ns,
            "acceleration_lag_ns": settings.acceleration_lag_ns,
            "magnetometer": f"none: {why}" if why else "AK8963, 16 bit",
        }

    def read(self, timeout_s: float) -> Reading[ImuSample] | None:
        """What the FIFO holds at the next moment to empty it; None if that is too far off."""
        bus, chip = self._connected()
        end_ns = bus.now_ns() + round(timeout_s * 1e9)
        while True:
            wait_ns = self._next_ns - bus.now_ns()
            bus.pause(min(max(wait_ns, 0), max(end_ns - bus.now_ns(), 0)) * 1e-9)
            if bus.now_ns() < self._next_ns:
                return None
            try:
                chunk = self._poll(bus, chip)
            except OSError as err:
                self._stumble(chip, err)
                continue
            if chunk is not None:
                self._failures = 0
                return self._decoder.feed(chunk)
            self._check_silence(bus)

    def self_test(self) -> SelfTest:
        """Whether gyro and accelerometer answer their own test; takes about a second, at rest.

        The device stays connected; its clock begins a new epoch. Raises `DriverError`.
        """
        bus, chip = self._connected()
        try:
            result = measure_self_test(bus, chip.address)
            self._chip = chip = start(bus, self.config)
            restart_fifo(bus, chip.address)
        except OSError as err:
            if isinstance(err, DriverError):
                raise
            raise DeviceLostError(f"{self.name}: failed in its self test ({err})") from err
        self._note_start(bus)
        return result

    def close(self) -> None:
        """Let the chip sleep and give the bus back."""
        bus, chip, self._bus = self._bus, self._chip, None
        if bus is None:
            return
        if chip is not None:
            with contextlib.suppress(OSError):
                stop(bus, chip.address)
        bus.close()

    def _connected(self) -> tuple[Bus, Chip]:
        bus, chip = self._bus, self._chip
        if bus is None or chip is None:
            raise DeviceLostError(f"{self.name}: not connected; call connect() first")
        return bus, chip

    def _note_start(self, bus: Bus) -> None:
        """The next chunk tells the settings, and with them that the clock starts anew."""
        self._starting, self._disturbed = True, False
        self._counted_ns = bus.now_ns()
        self._plan(bus)

    def _plan(self, bus: Bus) -> None:
        """When to poll next.

        A whole number of periods and the golden section of one: so the moments at which we look
        spread evenly over the sampling period, and some of them are just after a sample. Those are
        what the clock filter lives on; at whole periods it could be off by one of them for minutes.
        """
        period_ns = self._connected()[1].settings.period_ns
        self._next_ns = bus.now_ns() + round((max(POLL_NS // period_ns, 1) + 0.618) * period_ns)

    def _poll(self, bus: Bus, chip: Chip) -> Chunk | None:
        """Every whole frame of the FIFO, the magnetometer's reading, and a new start if it is due.

        None if there is not one frame yet.
        """
        self._plan(bus)
        if self._disturbed:
            self._restart(bus, chip)
            return None
        high, low = bus.read_block(chip.address, reg.FIFO_COUNT, 2)
        counted_ns = bus.now_ns()
        filled = (high << 8 | low) & 0x1FFF
        frames = filled // reg.FRAME_BYTES
        if frames == 0:
            return None
        record = settings_record(chip.settings) if self._starting else b""
        if chip.settings.sensitivity is not None:
            field = bus.read_block(reg.AK_ADDRESS, reg.AK_STATUS_1, reg.AK_READ_BYTES)
            record += magnetometer_record(field)
        data = bus.read_block(chip.address, reg.FIFO_R_W, frames * reg.FRAME_BYTES)
        now_ns = bus.now_ns()
        # Asked last: a FIFO that ran over at any time until now holds a cut frame at its end, and
        # what came after it would be read out of step for ever.
        status = bus.read_block(chip.address, reg.INT_STATUS, 1)[0]
        overflow = filled > reg.FULL_FRAMES_BYTES or bool(status & reg.OVERFLOW)
        self._starting, self._heard_ns = False, now_ns
        elapsed_ns, self._counted_ns = counted_ns - self._counted_ns, counted_ns
        if overflow:
            self._count("fifo_overflows")
            self._lose(elapsed_ns, frames, chip)
            self._restart(bus, chip)
        return Chunk(now_ns, record + fifo_record((now_ns - counted_ns) // 1000, data))

    def _restart(self, bus: Bus, chip: Chip) -> None:
        """Throw away what the FIFO holds; the samples until now are lost and estimated by time."""
        restart_fifo(bus, chip.address)
        self._lose(bus.now_ns() - self._counted_ns, 0, chip)
        self._note_start(bus)

    def _lose(self, elapsed_ns: int, received: int, chip: Chip) -> None:
        expected = elapsed_ns // chip.settings.period_ns
        self.counters.lost_samples += max(expected - received, 0)

    def _stumble(self, chip: Chip, err: OSError) -> None:
        """A transfer failed: frames may be cut, so begin anew; after a few in a row give up."""
        self._failures += 1
        self._disturbed = True
        self._count("bus_errors")
        if self._bus is None or self._failures >= FAILURES:
            raise DeviceLostError(
                f"{self.name}: the chip at 0x{chip.address:02x} does not answer any more ({err}); "
                "check its wires and power"
            ) from err

    def _check_silence(self, bus: Bus) -> None:
        if bus.now_ns() - self._heard_ns > SILENT_NS:
            raise DeviceLostError(
                f"{self.name}: the chip answers and measures nothing since "
                f"{SILENT_NS / 1e9:.1f} s; it was reset, most likely by a dip of its power"
            )

    def _count(self, name: str) -> None:
        self.counters.details[name] = self.counters.details.get(name, 0) + 1
