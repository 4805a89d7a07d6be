"""A V4L2 camera: the frames as the camera compressed them, stamped in the kernel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from drivers.camera.frame import Frame
from drivers.camera.header import read_jpeg_header
from drivers.camera.v4l2 import faults
from drivers.camera.v4l2.config import V4l2Config
from drivers.camera.v4l2.settings import apply_controls, apply_mode, controls_in_force
from drivers.camera.v4l2.source import (
    EXPOSURE_UNIT_NS,
    Control,
    DeviceFacts,
    Grab,
    VideoSource,
)
from drivers.camera.v4l2.stamps import Stamped, measured_rate_hz, on_our_clock, stamped
from drivers.device import Counters, Reading
from drivers.errors import DeviceFaultError, DeviceLostError, DriverError

FIRST_FRAME_S = 3.0
CHECK_S, CHECK_FRAMES, UNEVEN_FRAMES = 1.0, 12, 2
"""The rate is measured over so many frames or so long, after the first two."""
SLOW = 1.5
"""A frame so many periods after the last one came slowly: exposure in the dark, most often."""


def open_linux(path: str) -> VideoSource:
    """The machine's own camera; raises `OSError`, and `DriverError` if linuxpy is missing."""
    from drivers.camera.v4l2.linux_source import LinuxSource

    return LinuxSource(path)


class V4l2Camera:
    """A camera on this machine; a `drivers.Device` of `Frame`.

    A frame with damaged data is counted in `bad_frames` and still given, with its `fault`: the
    recording is the raw record. Holes in the driver's count are `lost_samples`. In the details:
    `slow_frames` that the camera itself took late, `odd_stamps` that could not be, and
    `sequence_steps_back`.
    """

    def __init__(
        self, config: V4l2Config, open_source: Callable[[str], VideoSource] = open_linux
    ) -> None:
        self.config = config
        self.counters = Counters()
        self._open = open_source
        self._source: VideoSource | None = None
        self._slow_ns = round(SLOW * 1e9 / config.rate_hz)
        self._closes = 0  # counted, so that `connect` sees one that came in between
        self._told: dict[str, object] = {}
        self._exposure_ns: int | None = None
        self._ours, self._epoch = True, 0
        self._sequence = 0
        self._latest_stamp_ns, self._latest_ns = 0, 0

    @property
    def name(self) -> str:
        """`camera on /dev/v4l/by-id/...`."""
        return f"camera on {self.config.path}"

    def connect(self) -> None:
        """Open, set, read back, start, and see that frames come at the asked rate.

        Raises `DriverError`, within five seconds.
        """
        self.close()
        closes = self._closes
        with _refusals(lambda err: faults.opening_error(self.config.path, err)):
            source = self._open(self.config.path)
        self._source = source
        try:
            if self._closes == closes:
                self._set_up(source)
        except BaseException:
            self.close()
            raise
        if self._closes != closes:
            self.close()
            raise DeviceLostError(f"{self.config.path}: closed while it was being connected")

    def identify(self) -> Mapping[str, object]:
        """Card, driver, bus, serial number, and every setting as the camera has it; {} before."""
        return dict(self._told)

    def read(self, timeout_s: float) -> Reading[Frame] | None:
        """The next frame; None if none came in time.

        Raises `DeviceLostError` when the camera is gone, or silent for longer than `silence_s`.
        """
        source = self._source
        if source is None:
            raise DeviceLostError(f"{self.config.path}: not connected; call connect() first")
        try:
            grab = source.read(timeout_s)
        except OSError as err:
            raise faults.lost_error(self.config.path, err) from err
        if grab is None:
            silent_s = (source.now_ns() - self._latest_ns) * 1e-9
            if silent_s > self.config.silence_s:
                self.counters.timeouts += 1
                raise faults.lost_error(self.config.path, None, silent_s)
            return None
        self._latest_ns = grab.arrival_ns
        return self._reading(grab)

    def close(self) -> None:
        """Stop the stream and give the camera back."""
        self._closes += 1
        source, self._source = self._source, None
        if source is not None:
            source.close()

    def _set_up(self, source: VideoSource) -> None:
        config = self.config
        with _refusals(lambda err: faults.opening_error(config.path, err)):
            facts = source.facts()
        if not facts.captures:
            raise faults.not_capturing_error(config.path, facts)
        with _refusals(lambda err: faults.mode_error(config, facts, err)):
            rate_hz = apply_mode(source, config, facts)
            apply_controls(source, config, facts)
            controls = controls_in_force(source)
            self._exposure_ns = None
            if config.exposure_s is not None:
                self._exposure_ns = source.get_control(Control.EXPOSURE_ABSOLUTE) * EXPOSURE_UNIT_NS
        with _refusals(lambda err: faults.start_error(config, facts, err)):
            source.start(config.buffers)
            measured_hz = self._check_stream(source, facts)
        self._told = self._description(facts, controls, rate_hz, measured_hz)

    def _check_stream(self, source: VideoSource, facts: DeviceFacts) -> float | None:
        """Take the first frames, for the rate and the clock of the stamps; the rate found."""
        grabs = self._first_frames(source, facts)
        claims = [on_our_clock(grab) for grab in grabs]
        self._ours = 2 * sum(claims) > len(claims)
        self._epoch += 1
        self._sequence = grabs[-1].sequence
        self._latest_stamp_ns, self._latest_ns = grabs[-1].stamp_ns, grabs[-1].arrival_ns
        rate_hz = measured_rate_hz(grabs[UNEVEN_FRAMES:], ours=self._ours)
        asked_hz = self.config.rate_hz
        if rate_hz is not None and rate_hz < asked_hz * (1 - self.config.rate_tolerance):
            raise DeviceFaultError(
                f"{self.config.path}: asked {facts.card} for {asked_hz:g} frames a second, got "
                f"{rate_hz:.1f}{faults.bus_hint(self.config, facts)}; in the dark automatic "
                "exposure slows a camera: set exposure_s, add light, or ask for that rate"
            )
        return rate_hz

    def _first_frames(self, source: VideoSource, facts: DeviceFacts) -> list[Grab]:
        start_ns = source.now_ns()
        first = self._next(source, start_ns + round(FIRST_FRAME_S * 1e9))
        if first is None:
            raise faults.silent_error(self.config, facts, (source.now_ns() - start_ns) * 1e-9)
        grabs = [first]
        end_ns = source.now_ns() + round(CHECK_S * 1e9)
        while len(grabs) < UNEVEN_FRAMES + CHECK_FRAMES:
            grab = self._next(source, end_ns)
            if grab is None:
                break
            grabs.append(grab)
        return grabs

    def _next(self, source: VideoSource, end_ns: int) -> Grab | None:
        """The next frame until a deadline, or until somebody closes the camera."""
        while self._source is source and source.now_ns() < end_ns:
            grab = source.read((end_ns - source.now_ns()) * 1e-9)
            if grab is not None:
                return grab
        return None

    def _reading(self, grab: Grab) -> Reading[Frame]:
        self._look_at_stamp(grab, self._missing_before(grab))
        when = stamped(grab, ours=self._ours, exposure_ns=self._exposure_ns, epoch=self._epoch)
        frame = self._frame(grab, when)
        self.counters.samples += 1
        if frame.fault is not None:
            self.counters.bad_frames += 1
        return Reading(ticks=() if when.tick is None else (when.tick,), samples=(frame,))

    def _missing_before(self, grab: Grab) -> int:
        """How many frames the camera took since the last one that never came; counted."""
        missing = grab.sequence - self._sequence - 1
        self._sequence = grab.sequence
        if missing < 0:  # a driver that starts its count anew, or that does not count at all
            self._count("sequence_steps_back")
            return 0
        self.counters.lost_samples += missing
        return missing

    def _look_at_stamp(self, grab: Grab, missing: int) -> None:
        """Count stamps that cannot be and frames that were slow; see a clock that restarts."""
        latest_ns, self._latest_stamp_ns = self._latest_stamp_ns, grab.stamp_ns
        if self._ours and not on_our_clock(grab):
            self._count("odd_stamps")
            self._latest_stamp_ns = 0
        elif latest_ns and grab.stamp_ns < latest_ns:
            self._epoch += 0 if self._ours else 1
        elif latest_ns and grab.stamp_ns - latest_ns > (missing + 1) * self._slow_ns:
            self._count("slow_frames")

    def _frame(self, grab: Grab, when: Stamped) -> Frame:
        return Frame(
            t_ns=when.t_ns,
            stamp=when.stamp,
            sequence=grab.sequence,
            format=self.config.format,
            data=grab.data,
            width_px=self.config.width_px,
            height_px=self.config.height_px,
            arrival_ns=grab.arrival_ns,
            device_ns=when.device_ns,
            exposure_ns=self._exposure_ns,
            fault=frame_fault(grab, self.config),
        )

    def _count(self, name: str) -> None:
        self.counters.details[name] = self.counters.details.get(name, 0) + 1

    def _stamps_by(self) -> str:
        if self._ours:
            return "the kernel, monotonic"
        return "another clock" if self._latest_stamp_ns else "arrival; the driver gives no stamps"

    def _description(
        self,
        facts: DeviceFacts,
        controls: Mapping[str, int],
        rate_hz: float | None,
        measured_hz: float | None,
    ) -> dict[str, object]:
        return {
            "model": facts.card,
            "driver": facts.driver,
            "bus": facts.bus,
            "usb_id": facts.usb_id,
            "usb_mbit_s": facts.usb_mbit_s,
            "serial": facts.serial,
            "path": self.config.path,
            "node": facts.node,
            "fourcc": self.config.fourcc,
            "width_px": self.config.width_px,
            "height_px": self.config.height_px,
            "rate_asked_hz": self.config.rate_hz,
            "rate_told_hz": rate_hz,
            "rate_measured_hz": None if measured_hz is None else round(measured_hz, 3),
            "stamps_by": self._stamps_by(),
            "controls": dict(controls),
        }


def frame_fault(grab: Grab, config: V4l2Config) -> str | None:
    """What is wrong with a buffer's bytes for the mode in force; None if nothing shows."""
    if grab.damaged:
        return "the driver says that data was lost"
    if config.frame_bytes is not None:
        got, expected = len(grab.data), config.frame_bytes
        return None if got == expected else f"{got} bytes instead of {expected}"
    header = read_jpeg_header(grab.data)
    if header.fault is not None:
        return header.fault
    if (header.width_px, header.height_px) != (config.width_px, config.height_px):
        return f"{header.width_px} x {header.height_px} pixels instead of the mode's"
    return None


@contextmanager
def _refusals(explain: Callable[[OSError], DriverError]) -> Iterator[None]:
    """Turn the system's errors into ours; ours pass, which are `OSError`s too in part."""
    try:
        yield
    except DriverError:
        raise
    except OSError as err:
        raise explain(err) from err
