"""What a camera gives -> a `CompressedImage` for each frame, in a log of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from capture.clock import ClockFilter, UtcLine
from capture.recording.translation import LogMessage
from capture.sensor_messages import image_message
from capture.topics import IMAGE_TYPE
from drivers import Reading
from drivers.camera import Frame


class CameraTranslator:
    """Messages of one camera; the stamp is the middle of the exposure.

    frame_id : the frame in which the camera looks; log_name, topic : where its images go.
    """

    def __init__(self, utc: UtcLine, topic: str, log_name: str, frame_id: str) -> None:
        self.topic, self.log_name = topic, log_name
        self._utc, self._frame_id = utc, frame_id
        self._clock = ClockFilter()
        self._stamped_by = ""

    def messages(self, reading: Reading[Frame]) -> Iterator[LogMessage]:
        """One message for each frame."""
        self._clock.observe_all(reading.ticks)
        for frame in reading.samples:
            stamp_ns = self._utc.utc(self._measured_ns(frame))
            self._stamped_by = frame.stamp.value
            data = image_message(stamp_ns, self._frame_id, frame.format, frame.data)
            yield LogMessage(self.topic, IMAGE_TYPE, data, frame.arrival_ns, stamp_ns)

    def _measured_ns(self, frame: Frame) -> int:
        line = self._clock.line
        if frame.device_ns is None or line is None:
            return frame.t_ns
        return line.ours(frame.device_ns)

    def state(self) -> Mapping[str, object]:
        """What the stamps rest on."""
        return {"stamped_by": self._stamped_by}
