"""SparkFun's 9DoF Razor IMU M0 as a device, whichever firmware it runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

from dialogue import UsageError
from drivers.device import Counters, Reading
from drivers.errors import DeviceFaultError, DeviceLostError
from drivers.imu.mpu9250 import registers as reg
from drivers.imu.razor.ahrs import AhrsDecoder
from drivers.imu.razor.columns import WISHED
from drivers.imu.razor.lines import frame_of
from drivers.imu.razor.protocol import (
    ACCELERATION_LAG_NS,
    GYRO_DELAY_NS,
    Layout,
    MillisClock,
    RazorDecoder,
)
from drivers.imu.razor.setting import RATE_HZ, Setting, bring_to_wish
from drivers.imu.razor.talk import USB_BAUD, Firmware, Talk, recognise
from drivers.imu.sample import ImuSample
from drivers.port import Port, SerialPort, drain

CONNECT_S = 4.8
SILENT_NS = 1_000_000_000


@dataclass(frozen=True)
class RazorConfig:
    """Where the Razor is and what may be changed in its flash.

    port : its device path; accel_range_g, gyro_range_deg_s : full scales that the default firmware
    is to be set to, None leaves them. The accelerometer's is seen at rest; the gyro's cannot be
    seen, so it is taken for the factory's 2000 deg/s unless it is given here: then the key G is
    pressed until the board names it, which wears its flash by up to four writes a start.
    Raises `UsageError` for a full scale that there is not.
    """

    port: str = "/dev/ttyACM0"
    accel_range_g: int | None = None
    gyro_range_deg_s: int | None = None

    def __post_init__(self) -> None:
        """Refuse what the board cannot do."""
        for name, value, allowed in (
            ("accel_range_g", self.accel_range_g, reg.ACCEL_RANGES_G),
            ("gyro_range_deg_s", self.gyro_range_deg_s, reg.GYRO_RANGES_DEG_S),
        ):
            if value is not None and value not in allowed:
                raise UsageError(
                    f"Razor IMU: {name} is {value}; the board knows "
                    f"{', '.join(str(one) for one in allowed)}"
                )


class Razor:
    """A Razor IMU on a serial port: a `Device[ImuSample]`.

    Default firmware: brought to raw values at 100 Hz with time, accelerometer, gyro and
    magnetometer, by as few of its keys as possible; its millis() is the device's clock, and a
    sample's time is that of the angular velocity. AHRS firmware: text with acceleration and gyro,
    stamped by arrival. Nothing is changed on close; the board goes on streaming.
    """

    def __init__(
        self,
        config: RazorConfig | None = None,
        open_port: Callable[[str, int], Port] = SerialPort,
    ) -> None:
        self.config = config or RazorConfig()
        self.counters = Counters()
        self._open_port = open_port
        self._port: Port | None = None
        self._decoder: RazorDecoder | AhrsDecoder | None = None
        self._clock = MillisClock()
        self._identity: dict[str, object] = {}
        self._setting: Setting | None = None
        self._heard_ns = 0

    @property
    def name(self) -> str:
        """`Razor IMU on /dev/ttyACM0`."""
        return f"Razor IMU on {self.config.port}"

    def connect(self) -> None:
        """Open the port, recognise the firmware, bring the stream to what is wished."""
        port = self._open_port(self.config.port, USB_BAUD)
        try:
            talk = Talk(port, CONNECT_S)
            firmware, baud = recognise(talk)
            if firmware is Firmware.DEFAULT:
                self._decoder = self._start_default(talk)
            else:
                self._decoder = self._start_ahrs(talk, baud)
        except BaseException:
            port.close()
            raise
        self._heard_ns = port.now_ns()
        self._port = port

    def identify(self) -> Mapping[str, object]:
        """Firmware, layout of its lines, keys that were pressed, and what is not certain."""
        return {"name": self.name, **self._identity}

    def read(self, timeout_s: float) -> Reading[ImuSample] | None:
        """What the next bytes complete; None if none came in time."""
        port, decoder = self._port, self._decoder
        if port is None or decoder is None:
            raise DeviceLostError(f"{self.name}: not connected; call connect() first")
        chunk = port.read(timeout_s)
        try:
            reading = None if chunk is None else decoder.feed(chunk)
        except DeviceFaultError as err:
            raise DeviceFaultError(f"{self.name}: {err}") from err
        if reading is not None and reading.samples:
            self._heard_ns = port.now_ns()
        elif port.now_ns() - self._heard_ns > SILENT_NS:
            what = "nothing" if chunk is None else "no line that can be read"
            raise DeviceLostError(
                f"{self.name}: {what} came for {SILENT_NS / 1e9:.0f} s; it was paused, reset or "
                "set otherwise; connecting again brings it back"
            )
        return reading

    def close(self) -> None:
        """Give the port back."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _start_default(self, talk: Talk) -> RazorDecoder:
        known = self._setting
        gyro_wish = self.config.gyro_range_deg_s
        if known is not None and known.certain_gyro:
            gyro_wish = None  # it is in the board's flash since the last time
        setting = bring_to_wish(talk, self.config.accel_range_g, gyro_wish)
        if known is not None and known.certain_gyro:
            setting.gyro_range_deg_s, setting.certain_gyro = known.gyro_range_deg_s, True
        if known is not None and known.certain_accel and not setting.certain_accel:
            setting.accel_range_g, setting.certain_accel = known.accel_range_g, True
        self._setting = setting
        self._identity = _default_identity(setting)
        self._clock.restart()
        layout = Layout(WISHED, setting.accel_range_g, setting.gyro_range_deg_s)
        return RazorDecoder(layout, self.counters, self._clock)

    def _start_ahrs(self, talk: Talk, baud: int | None) -> AhrsDecoder:
        port = talk.port
        port.write(b"#o0")
        drain(port, limit_s=0.3)
        # The original firmware does not know #ox; then its sensors' text is asked for.
        for command, tag in ((b"#ox#o1", "YPRAG"), (b"#osct#o1", "G-C")):
            port.write(command)
            if _comes(talk, tag):
                self._identity = {
                    "model": "Razor IMU",
                    "firmware": Firmware.AHRS.value,
                    "lines": tag,
                    "line_baud": baud or "USB",
                    "clock": "none: samples are stamped by their arrival",
                }
                return AhrsDecoder(self.counters, baud)
        raise DeviceFaultError(
            f"{self.name}: its AHRS firmware gives neither #YPRAG nor #G-C lines; upload "
            "SparkFun's default firmware or that of the ROS package razor_imu_9dof"
        )


def _comes(talk: Talk, tag: str) -> bool:
    """Whether a line with this tag comes within half a second."""
    end_ns = talk.port.now_ns() + 500_000_000
    while (left_ns := end_ns - talk.port.now_ns()) > 0:
        text = talk.line(left_ns * 1e-9)
        frame = None if text is None else frame_of(text)
        if text is None or (frame is not None and frame.tag == tag):
            return frame is not None
    return False


def _default_identity(setting: Setting) -> dict[str, object]:
    accel, gyro = f"{setting.accel_range_g} g", f"{setting.gyro_range_deg_s} deg/s"
    return {
        "model": "Razor IMU M0 (MPU-9250)",
        "firmware": Firmware.DEFAULT.value,
        "rate_hz": RATE_HZ,
        "columns": asdict(setting.columns),
        "accel_range_g": setting.accel_range_g,
        "accel_range": accel if setting.certain_accel else f"{accel} (likely: it moved at start)",
        "gyro_range_deg_s": setting.gyro_range_deg_s,
        "gyro_range": gyro if setting.certain_gyro else f"{gyro} (the factory's: not to be seen)",
        "keys_pressed": setting.keys,
        "flash": "each key pressed is kept by the board" if setting.keys else "unchanged",
        "gyro_delay_ns": GYRO_DELAY_NS,
        "acceleration_lag_ns": ACCELERATION_LAG_NS,
    }
