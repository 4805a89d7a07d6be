"""What an IMU costs while recording: `uv run python benchmarks/imu_decoding.py`.

CPU time of our code for a minute of data, as a share of one core, against the limit of 3 %: the
MPU-9250's whole read loop over a bus that costs nothing, at 200 Hz and 1 kHz (on the car the kernel
adds its transfers, mostly waiting); the Razor's decoder at 100 Hz; and the Razor's whole read loop
for five real seconds behind a pseudo-terminal, by the CPU time of the reading thread. Each twice
over: the better counts, the machine being shared.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from drivers import Chunk, Counters, PtyEmulator
from drivers.imu.mpu9250 import FakeMpu9250Bus, Mpu9250, Mpu9250Config
from drivers.imu.mpu9250 import registers as reg
from drivers.imu.razor import Layout, MillisClock, Razor, RazorConfig, RazorDecoder, RazorModel
from drivers.imu.razor.columns import WISHED

MINUTE_S, REAL_S = 60.0, 5.0
LIMIT_PERCENT = 3.0


class CheapBus(FakeMpu9250Bus):
    """Once started, gives the same frame again and again, at the pace of the chip."""

    def begin(self, rate_hz: int) -> None:
        """From now on answer without emulating."""
        frame = super().read_block(self.address, reg.ACCEL_OUT, reg.FRAME_BYTES)
        self._many = frame * 64
        self._period_ns, self._emptied_ns = 10**9 // rate_hz, self._now_ns

    def read_block(self, address: int, register: int, count: int) -> bytes:
        """Frames by time."""
        if not hasattr(self, "_many"):
            return super().read_block(address, register, count)
        self._now_ns += 200_000
        if register == reg.FIFO_COUNT:
            frames = (self._now_ns - self._emptied_ns) // self._period_ns
            self._emptied_ns += frames * self._period_ns
            return (frames * reg.FRAME_BYTES).to_bytes(2, "big")
        return self._many[:count]


def mpu_percent(rate_hz: int) -> float:
    """Share of a core for the read loop of the MPU-9250."""
    bus = CheapBus()
    imu = Mpu9250(Mpu9250Config(rate_hz=rate_hz), lambda _: bus)
    imu.connect()
    bus.begin(rate_hz)
    end_ns = bus.now_ns() + round(MINUTE_S * 1e9)
    start = time.process_time()
    while bus.now_ns() < end_ns:
        imu.read(0.1)
    spent = time.process_time() - start
    assert imu.counters.samples > 0.97 * MINUTE_S * rate_hz, imu.counters
    return 100.0 * spent / MINUTE_S


def razor_decoder_percent() -> float:
    """Share of a core for decoding a Razor's lines, each in a chunk of its own."""
    model = RazorModel(columns=WISHED)
    model.starts_cut = False
    chunks = [Chunk(t, model.transmit(t)) for t in range(0, round(MINUTE_S * 1e9), 10**7)]
    decoder = RazorDecoder(Layout(), Counters(), MillisClock())
    start = time.process_time()
    for chunk in chunks:
        decoder.feed(chunk)
    spent = time.process_time() - start
    assert decoder.counters.samples > 0.99 * MINUTE_S * 100
    return 100.0 * spent / MINUTE_S


def razor_percent() -> float:
    """Share of a core for the thread that reads a Razor in real time."""
    with PtyEmulator(RazorModel(columns=WISHED)) as emulator:
        imu = Razor(RazorConfig(port=emulator.path))
        imu.connect()
        end, start = time.monotonic() + REAL_S, time.thread_time()
        while time.monotonic() < end:
            imu.read(0.1)
        spent = time.thread_time() - start
        imu.close()
    assert imu.counters.samples > 0.9 * REAL_S * 100
    return 100.0 * spent / REAL_S


def show(what: str, measure: Callable[[], float]) -> None:
    """One line: figure, limit, ratio."""
    percent = min(measure(), measure())
    print(
        f"{what}: {percent:.2f} % of a core (limit {LIMIT_PERCENT:.0f} %, "
        f"ratio {LIMIT_PERCENT / percent:.0f})"
    )


def main() -> None:
    """Measure and print."""
    show("MPU-9250 at 200 Hz, read loop", lambda: mpu_percent(200))
    show("MPU-9250 at 1 kHz, read loop", lambda: mpu_percent(1000))
    show("Razor at 100 Hz, decoder", razor_decoder_percent)
    show("Razor at 100 Hz, read loop on a pseudo-terminal", razor_percent)


if __name__ == "__main__":
    main()
