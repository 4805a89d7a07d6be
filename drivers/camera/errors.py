"""What can be wrong with the files that cameras read: images, videos, stamps, factory settings."""

from __future__ import annotations

from drivers.errors import DriverError


class CameraFileError(DriverError, ValueError):
    """A file or folder that cannot stand for a camera, or does not hold what it should."""
