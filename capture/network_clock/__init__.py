"""The clocks of other machines: asked over the network, and as chrony sees our own."""

from capture.network_clock.chrony import chrony_words
from capture.network_clock.peer_file import read_peer_clock, write_peer_clock
from capture.network_clock.round_trip import (
    PORT,
    MachineClocks,
    NetworkClockError,
    ask,
    host_and_port,
    opened_server,
    read_boot_id,
    serve,
)

__all__ = [
    "PORT",
    "MachineClocks",
    "NetworkClockError",
    "ask",
    "chrony_words",
    "host_and_port",
    "opened_server",
    "read_boot_id",
    "read_peer_clock",
    "serve",
    "write_peer_clock",
]
