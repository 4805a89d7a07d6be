"""The one that writes: everything recorded passes through here, in one thread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from capture.clock import UtcLine
from capture.log_writer import LogWriter, WrittenTopic
from capture.recording.facts import Losses, RecordingWatch
from capture.recording.translation import Translator
from capture.sensor_messages import Status, diagnostics_message
from capture.topics import (
    DIAGNOSTICS_TOPIC,
    DIAGNOSTICS_TYPE,
    IMAGE_LOGS,
    LOG_NAME,
)
from drivers import DeviceBack, DeviceLost, Reading


@dataclass(frozen=True)
class Diagnosis:
    """What the recorder saw of itself and its devices at `t_ns` (monotonic)."""

    t_ns: int
    statuses: Sequence[Status]


Item = Reading[Any] | DeviceLost | DeviceBack | Diagnosis


class Scribe:
    """Writes the logs of one recording into `folder` and keeps count of what it wrote.

    translators : by device; `take` and `finish` belong to one thread, counts may be read by others.
    """

    def __init__(
        self,
        folder: Path,
        translators: Mapping[str, Translator[Any]],
        utc: UtcLine,
        *,
        sync_period_s: float | None = 1.0,
    ) -> None:
        self.watch = RecordingWatch(utc.utc_ns)
        self.losses = dict.fromkeys(translators, Losses())
        self.gone = dict.fromkeys(translators, False)
        self.logs: dict[str, LogWriter] = {}
        self._folder, self._translators, self._utc = folder, translators, utc
        self._sync_period_s = sync_period_s
        self._open = ExitStack()

    def take(self, device: str, item: Item) -> None:
        """Write what a device brought, or note what happened to it; raises `LogError`."""
        if isinstance(item, Reading):
            self._write(self._translators[device], item)
        elif isinstance(item, Diagnosis):
            self._diagnose(item)
        else:
            self._note(device, item)

    def finish(self) -> dict[str, list[WrittenTopic]]:
        """End all logs; what each holds, by file name. Raises `LogError`."""
        self._open.close()
        return {name: list(log.topics.values()) for name, log in self.logs.items()}

    def abandon(self, error: BaseException) -> None:
        """Leave the logs as they are, without an end: after a disk that takes no more."""
        self._open.__exit__(type(error), error, error.__traceback__)

    def _write(self, translator: Translator[Any], reading: Reading[Any]) -> None:
        log = self._log(translator.log_name)
        for message in translator.messages(reading):
            log_t_ns = self._utc.utc(message.arrival_ns)
            log.write(
                message.topic,
                message.type_name,
                message.data,
                log_t_ns=log_t_ns,
                stamp_ns=message.stamp_ns,
            )
            self.watch.note(message.topic, log_t_ns)

    def _diagnose(self, diagnosis: Diagnosis) -> None:
        t_ns = self._utc.utc(diagnosis.t_ns)
        data = diagnostics_message(t_ns, diagnosis.statuses)
        log = self._log(self._main_log())
        log.write(DIAGNOSTICS_TOPIC, DIAGNOSTICS_TYPE, data, log_t_ns=t_ns, stamp_ns=t_ns)
        self.watch.note(DIAGNOSTICS_TOPIC, t_ns)
        if self._sync_period_s is not None:
            for other in self.logs.values():
                other.sync()

    def _note(self, device: str, event: DeviceLost | DeviceBack) -> None:
        known = self.losses[device]
        if isinstance(event, DeviceLost):
            error = " ".join(str(event.error).split())
            known = replace(known, disconnects=known.disconnects + 1, last_error=error)
        self.losses[device] = known
        self.gone[device] = isinstance(event, DeviceLost)

    def _main_log(self) -> str:
        """Where the diagnostics go: the log of the car, or of the camera if it films alone."""
        names = {translator.log_name for translator in self._translators.values()}
        return LOG_NAME if LOG_NAME in names or not names else min(names)

    def _log(self, name: str) -> LogWriter:
        if name not in self.logs:
            writer = LogWriter(
                self._folder / name,
                sync_period_s=self._sync_period_s,
                compressed=name not in IMAGE_LOGS,
            )
            self.logs[name] = self._open.enter_context(writer)
        return self.logs[name]
