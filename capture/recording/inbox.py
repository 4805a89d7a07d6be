"""Between the threads that read and the one that writes: a queue with a bound for each device."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Mapping
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Inbox(Generic[Item]):
    """Items of several sources in the order of arrival; safe between threads.

    bounds : how many items of each source may wait. What comes beyond is refused and counted in
    `refused`, so that a disk that stalls costs memory only up to a limit, and never unseen.
    """

    def __init__(self, bounds: Mapping[str, int]) -> None:
        self.refused: Counter[str] = Counter()
        self.high_water = 0
        self._bounds = dict(bounds)
        self._waiting: Counter[str] = Counter()
        self._items: deque[tuple[str, Item]] = deque()
        self._changed = threading.Condition()
        self._closed = False

    def put(self, source: str, item: Item) -> bool:
        """Hand in an item; False if it was refused because too many of its source wait."""
        with self._changed:
            if self._waiting[source] >= self._bounds[source]:
                self.refused[source] += 1
                return False
            self._waiting[source] += 1
            self._items.append((source, item))
            self.high_water = max(self.high_water, len(self._items))
            self._changed.notify()
            return True

    def get(self) -> tuple[str, Item] | None:
        """The oldest item, waited for; None once the inbox is closed and empty."""
        with self._changed:
            while not self._items and not self._closed:
                self._changed.wait()
            if not self._items:
                return None
            source, item = self._items.popleft()
            self._waiting[source] -= 1
            return source, item

    def close(self) -> None:
        """Let `get` end once all that waits is taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def __len__(self) -> int:
        """How many items wait."""
        return len(self._items)
