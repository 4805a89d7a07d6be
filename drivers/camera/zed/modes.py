"""The ZED's modes and USB ids (reference: protocols.md D.1; zed-open-capture and its udev file)."""

from __future__ import annotations

from dataclasses import dataclass

VENDOR = "2b03"
MODELS = {
    "2b03:f580": "ZED (early)",
    "2b03:f582": "ZED",
    "2b03:f680": "ZED-M",
    "2b03:f682": "ZED-M",
    "2b03:f780": "ZED 2",
    "2b03:f781": "ZED 2",
    "2b03:f880": "ZED 2i",
    "2b03:f881": "ZED 2i",
}
"""Model by vendor and product id; some ids are the sensor half of the same camera."""


@dataclass(frozen=True)
class ZedMode:
    """The size of one eye, the rates it is offered at, and its name in the settings file."""

    eye_width_px: int
    eye_height_px: int
    rates_hz: tuple[int, ...]
    settings_name: str

    @property
    def width_px(self) -> int:
        """Of the frame, which holds both eyes side by side."""
        return 2 * self.eye_width_px


ZED_MODES = {
    "HD2K": ZedMode(2208, 1242, (15,), "2K"),
    "HD1080": ZedMode(1920, 1080, (15, 30), "FHD"),
    "HD720": ZedMode(1280, 720, (15, 30, 60), "HD"),
    "VGA": ZedMode(672, 376, (15, 30, 60, 100), "VGA"),
}
