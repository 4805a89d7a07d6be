"""A VESC on a model of it, in simulated time, and others that might be on its port."""

from __future__ import annotations

from collections.abc import Sequence

from drivers import (
    ModelPort,
)
from drivers.device import Reading
from drivers.emulation import DeviceModel
from drivers.vesc import (
    Vesc,
    VescConfig,
    VescModel,
    VescValues,
    emulated_vesc,
)

MS, S = 1_000_000, 1_000_000_000
CONFIG = VescConfig(port="/dev/ttyACM0")


def made(model: DeviceModel, config: VescConfig = CONFIG) -> tuple[Vesc, ModelPort]:
    port = ModelPort(model, name=config.port)

    def open_port(path: str, baud: int) -> ModelPort:
        assert (path, baud) == (config.port, config.baud)
        port.plug()
        return port

    return Vesc(config, open_port), port


def readings(vesc: Vesc, port: ModelPort, seconds: float) -> list[Reading[VescValues]]:
    end_ns, all_of_them = port.now_ns() + round(seconds * 1e9), []
    while port.now_ns() < end_ns:
        reading = vesc.read(min((end_ns - port.now_ns()) * 1e-9, 0.1))
        if reading is not None:
            all_of_them.append(reading)
    return all_of_them


def samples(all_of_them: Sequence[Reading[VescValues]]) -> list[VescValues]:
    return [values for reading in all_of_them for values in reading.samples]


class Stranger:
    """Another device, or none: says one thing every `period_ns`, whatever it hears."""

    def __init__(self, data: bytes = b"", period_ns: int = 10 * MS) -> None:
        self.data, self.period_ns, self.at_ns = data, period_ns, 0

    def receive(self, data: bytes, now_ns: int) -> None:
        pass

    def transmit(self, now_ns: int) -> bytes:
        said = b""
        while self.data and self.at_ns <= now_ns:
            said, self.at_ns = said + self.data, self.at_ns + self.period_ns
        return said

    def next_ns(self) -> int | None:
        return self.at_ns if self.data else None


def connected(firmware: str = "5.02", config: VescConfig = CONFIG) -> tuple[Vesc, ModelPort]:
    vesc, port = made(emulated_vesc(firmware), config)
    vesc.connect()
    return vesc, port


def model_of(port: ModelPort) -> VescModel:
    assert isinstance(port.model, VescModel)
    return port.model
