"""From a buffer's stamp and flags to the middle of the exposure.

uvcvideo marks every stamp as monotonic and as start of exposure, whatever its parameters say. In
truth it is, with the module's defaults, the time at which the frame's first USB packet came (the
middle of the exposure lies earlier by the camera's own latency, which only a comparison with the
gyro shows), and with clock=CLOCK_REALTIME it is not monotonic at all: so a stamp must prove itself
against the arrival. Behind a rolling shutter it is the middle of the first row's exposure; the last
row's is later by the read-out time, which no camera tells. Source: kernel,
drivers/media/usb/uvc; docs.kernel.org, V4L2 buffer flags.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.camera.frame import Stamp
from drivers.camera.v4l2.source import Grab, StampClock, StampEdge
from drivers.device import Tick

OLDEST_NS = 2_000_000_000
"""A frame that waits longer in the driver's buffers than this does not exist: see `silence_s`."""
NEWEST_NS = 1_000_000
"""A stamp may lie in the future by so much: two reads of one clock on two processors."""


@dataclass(frozen=True)
class Stamped:
    """When a frame was exposed, by what, and what its stamp says of the camera's clock."""

    t_ns: int
    stamp: Stamp
    device_ns: int | None = None
    tick: Tick | None = None


def on_our_clock(grab: Grab) -> bool:
    """Whether a stamp claims to be monotonic and can be."""
    age_ns = grab.arrival_ns - grab.stamp_ns
    return grab.clock is StampClock.MONOTONIC and -NEWEST_NS <= age_ns <= OLDEST_NS


def stamped(grab: Grab, *, ours: bool, exposure_ns: int | None, epoch: int) -> Stamped:
    """The middle of a frame's exposure; ours : whether this camera stamps by our clock."""
    half_ns = (exposure_ns or 0) // 2
    starts = grab.edge is StampEdge.EXPOSURE_START
    middle_ns = grab.stamp_ns + (half_ns if starts else -half_ns)
    if ours and on_our_clock(grab):
        return Stamped(middle_ns, Stamp.EXPOSURE_START if starts else Stamp.FRAME_END)
    arrival = Stamped(grab.arrival_ns - half_ns, Stamp.ARRIVAL)
    if ours or grab.stamp_ns == 0:
        return arrival
    # The frame cannot be here before it was exposed; how long it travels then is not known.
    delay_ns = (exposure_ns or 0) if starts else 0
    tick = Tick(grab.stamp_ns, grab.arrival_ns, delay_ns, epoch)
    return Stamped(arrival.t_ns, arrival.stamp, middle_ns, tick)


def measured_rate_hz(grabs: Sequence[Grab], *, ours: bool) -> float | None:
    """Frames a second that the camera takes, lost ones counted; None with fewer than four frames.

    The median of the intervals: the first frames of a stream come unevenly.
    """
    if len(grabs) < 4:
        return None
    times = [grab.stamp_ns if ours else grab.arrival_ns for grab in grabs]
    intervals = [
        (times[k] - times[k - 1]) / max(grabs[k].sequence - grabs[k - 1].sequence, 1)
        for k in range(1, len(grabs))
    ]
    interval_ns = statistics.median(intervals)
    return 1e9 / interval_ns if interval_ns > 0 else None
