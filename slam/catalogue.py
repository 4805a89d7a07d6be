"""Which algorithms there are: ours, and those that other distributions offer.

Both are entry points of the group `trackside.slam`: a name, and where an `slam.Algorithm` stands.
None is imported before it is asked for, so that one that is broken harms no other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from slam.errors import SlamError
from slam.interface import Algorithm

GROUP = "trackside.slam"

_OURS = {
    "ekf": "slam.ekf:EKF",
    "ekf-fej": "slam.gaussian.filter:FEJ",
    "ukf": "slam.gaussian.filter:UKF",
    "fastslam": "slam.fastslam.filter:FASTSLAM",
    "fastslam2": "slam.fastslam2.filter:FASTSLAM2",
    "smoother": "slam.smoother.filter:SMOOTHER",
}


class Catalogue(Mapping[str, "Algorithm[Any]"]):
    """The algorithms by name, each loaded when it is asked for; a name of ours is always ours.

    Any: of which kind a configuration is, only its algorithm knows.
    """

    def __iter__(self) -> Iterator[str]:
        """The names, ours first; loads nothing."""
        return iter([*_OURS, *sorted({entry.name for entry in _offered()} - set(_OURS))])

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        return name in _OURS or name in list(iter(self))

    def __getitem__(self, name: str) -> Algorithm[Any]:
        """The algorithm of that name.

        Raises `SlamError` when it cannot be loaded, is no `Algorithm`, or is offered twice.
        """
        entry = _entry(name)
        try:
            found = entry.load()
        except Exception as err:  # whatever a stranger's module does when it is imported
            why = f"{type(err).__name__}: {err}"
            raise SlamError(f"{_told(entry)} cannot be loaded: {why}; {_REMEDY}") from err
        if not isinstance(found, Algorithm):
            kind = type(found).__name__
            raise SlamError(f"{_told(entry)} is a {kind}, expected a slam.Algorithm; {_REMEDY}")
        return found

    def distribution(self, name: str) -> str | None:
        """Name and version of the distribution that brought it; None where it is ours."""
        owner = _entry(name).dist
        return f"{owner.name} {owner.version}" if owner else None


ALGORITHMS = Catalogue()

_REMEDY = "mend or uninstall its distribution; the other algorithms are not concerned"


def _offered() -> list[EntryPoint]:
    return list(entry_points(group=GROUP))


def _entry(name: str) -> EntryPoint:
    """Where the algorithm stands; one told twice (two folders hold its metadata) counts once."""
    if name in _OURS:
        return EntryPoint(name, _OURS[name], GROUP)
    entries = {entry.value: entry for entry in _offered() if entry.name == name}
    if not entries:
        raise KeyError(name)
    if len(entries) > 1:
        raise SlamError(
            f"{' and '.join(_told(entry) for entry in entries.values())}: the name is offered "
            "twice; uninstall one of the distributions"
        )
    return next(iter(entries.values()))


def _told(entry: EntryPoint) -> str:
    owner = f"{entry.dist.name} {entry.dist.version}" if entry.dist else "trackside"
    return f"algorithm {entry.name!r} of {owner} ({entry.value})"
