"""What reading a VESC costs: `uv run python benchmarks/vesc_decoding.py`.

Microseconds for one GET_VALUES frame (79 bytes, firmware from 5.03): found in the bytes, checked,
and made a `VescValues`. Beside it, measured in turn with it, the least that any program must do:
one `struct` and one CRC, at known places, to a tuple. PyVESC took 78.9 us where that took 0.57 us
(reference/protocols.md H), so 138 times as long; that ratio is the limit. CPU time, medians of
rounds: the ratio depends hardly on the machine, and not on what else it does.
"""

from __future__ import annotations

import statistics
import struct
import time
from binascii import crc_hqx
from collections.abc import Callable

from drivers.vesc import Firmware, FrameReceiver, decode_values

# A real frame, from the unit tests of the `vesc` crate of Rust.
FRAME = bytes.fromhex(
    "024A040114000000000025000000030000000000000020006E000003FB017D0000001100000000"
    "0000028900000000FFFF6F4B00029FC700046A7C28010115FC4CFC0D000000E5000008D6003A9703"
)
PACKING = struct.Struct(">BhhiiiihihiiiiiiBiBhhhiiB")
FIRMWARE = Firmware(5, 3)
FRAMES, ROUNDS = 1000, 41
PYVESC_RATIO = 138.0
POLL_HZ = 50.0


def plain(frame: bytes) -> tuple[int, ...]:
    """A tuple of raw integers of a frame that is known to begin here."""
    payload = frame[2:76]
    if crc_hqx(payload, 0) != frame[76] << 8 | frame[77]:
        raise ValueError("wrong CRC")
    return PACKING.unpack(payload)


def microseconds(job: Callable[[], object]) -> float:
    """Of one frame, in one round."""
    start = time.process_time()
    for _ in range(FRAMES):
        job()
    return 1e6 * (time.process_time() - start) / FRAMES


def main() -> None:
    """Measure and print."""
    receiver = FrameReceiver()
    (frame,) = receiver.feed(FRAME)
    jobs: dict[str, Callable[[], object]] = {
        "plain struct and CRC": lambda: plain(FRAME),
        "frame found and checked": lambda: receiver.feed(FRAME),
        "values made": lambda: decode_values(frame.payload, FIRMWARE),
        "all of it": lambda: decode_values(receiver.feed(FRAME)[0].payload, FIRMWARE),
    }
    rounds = [{name: microseconds(job) for name, job in jobs.items()} for _ in range(ROUNDS)]
    medians = {name: statistics.median(each[name] for each in rounds) for name in jobs}
    for name, median in medians.items():
        print(f"{name + ':':26}{median:7.2f} us")
    ratio = medians["all of it"] / medians["plain struct and CRC"]
    print(f"ratio to plain: {ratio:.1f} (limit: PyVESC's {PYVESC_RATIO:.0f})")
    print(f"at {POLL_HZ:.0f} Hz: {medians['all of it'] * POLL_HZ * 1e-4:.3f} % of a core")


if __name__ == "__main__":
    main()
