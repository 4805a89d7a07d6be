"""A Razor on a model of its board, in simulated time."""

from __future__ import annotations

from drivers import (
    DeviceModel,
    ModelPort,
)
from drivers.imu.razor import (
    AhrsModel,
    Razor,
    RazorConfig,
)


class SpeedPort(ModelPort):
    """Tells an AHRS model at which speed the host listens."""

    def set_baud(self, baud: int) -> None:
        super().set_baud(baud)
        assert isinstance(self.model, AhrsModel)
        self.model.host_baud = baud


def device(model: DeviceModel, config: RazorConfig | None = None) -> tuple[Razor, ModelPort]:
    kind = SpeedPort if isinstance(model, AhrsModel) else ModelPort
    port = kind(model, name="/dev/ttyACM0")

    def open_port(path: str, baud: int) -> ModelPort:
        assert (path, baud) == ("/dev/ttyACM0", 115200)
        port.closed = False
        if isinstance(model, AhrsModel) and model.baud is not None:
            model.host_baud = baud
        return port

    return Razor(config, open_port), port
