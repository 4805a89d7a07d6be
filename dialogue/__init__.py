"""How trackside speaks to a person: errors that can be acted on, tables, progress, the end.

The lowest floor. Every other room uses it; it knows none of them.
"""

from dialogue.ending import asked_to_end
from dialogue.errors import TracksideError, UsageError, nearest_names
from dialogue.progress import Progress
from dialogue.table import TABLE_FORMATS, Cell, Table

__all__ = [
    "TABLE_FORMATS",
    "Cell",
    "Progress",
    "Table",
    "TracksideError",
    "UsageError",
    "asked_to_end",
    "nearest_names",
]
