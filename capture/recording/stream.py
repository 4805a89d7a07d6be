"""A device to record, and what is asked of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from capture.recording.still import StillPeriod
from capture.recording.translation import Translator
from drivers import Device


@dataclass(frozen=True)
class Stream:
    """A device to record: how it becomes messages, what is asked of it.

    asked_hz : messages per second on the translator's topic, None for what the device says of
    itself (`rate_hz` of its identity), if it does; waiting : how many of its readings may wait for
    the disk; still : of an IMU, begins with the recording; is_finished : of footage, whether its
    last frame was given, which ends the recording.
    """

    device: Device[Any]
    translator: Translator[Any]
    asked_hz: float | None = None
    waiting: int = 4000
    still: StillPeriod | None = None
    is_finished: Callable[[], bool] = lambda: False
