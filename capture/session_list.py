"""Which sessions a folder holds."""

from __future__ import annotations

from pathlib import Path

from capture.errors import SessionError
from capture.session_info import FILE_NAME


def list_sessions(folder: Path) -> tuple[Path, ...]:
    """The session folders in `folder`, sorted; the folder itself if it is a session.

    Raises `SessionError` when the folder cannot be read or holds none.
    """
    try:
        if (folder / FILE_NAME).exists():
            return (folder,)
        found = sorted(
            child
            for child in folder.iterdir()
            if not child.name.startswith(".") and (child / FILE_NAME).exists()
        )
    except OSError as err:
        raise SessionError(
            f"{folder}: cannot be read: {err.strerror or err}; check path, owner and mode"
        ) from err
    if not found:
        raise SessionError(
            f"{folder}: holds no sessions; give a folder with folders that trackside record or "
            "trackside import made"
        )
    return tuple(found)
