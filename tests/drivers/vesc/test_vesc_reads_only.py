"""What a logger may say: questions, and nothing else."""

from __future__ import annotations

import ast
import inspect
import threading

import pytest
from vesc_talk import Stranger, made, readings

from drivers import (
    DriverError,
    ModelPort,
)
from drivers.vesc import (
    ASK_SETUP,
    ODOMETRY_MASK,
    FrameReceiver,
    VescConfig,
    channel,
    driver,
    emulated_vesc,
    handshake,
)
from drivers.vesc.channel import ReadChannel
from drivers.vesc.emulator import FIRMWARES


def test_every_byte_that_a_logger_writes_is_a_question() -> None:
    """Through every firmware, every fault, lost devices, and other devices on the port."""
    allowed = {0, 4, 47, 50, 51, 65}
    for firmware in FIRMWARES:
        model = emulated_vesc(firmware)
        mask = ODOMETRY_MASK if model.firmware.version >= (3, 48) else None
        vesc, port = made(model, VescConfig(port="/dev/ttyACM0", mask=mask))
        vesc.connect()
        faults = model.faults
        faults.prints, faults.flip_every, faults.piece_bytes = True, 3, 20
        readings(vesc, port, 2.0)
        faults.fault_code, faults.lose_every, faults.noise = 1, 2, b"\x02\x03\x0c"
        readings(vesc, port, 2.0)
        if mask:
            vesc.ask(ASK_SETUP)
        faults.silent = True
        with pytest.raises(DriverError):
            readings(vesc, port, 5.0)
        with pytest.raises(DriverError):
            vesc.connect()
        vesc.close()
        receiver = FrameReceiver()
        frames = receiver.feed(bytes(port.written))
        assert {frame.payload[0] for frame in frames} <= allowed
        assert receiver.expire() == []
        assert receiver.bad_bytes == 0  # every byte is part of such a frame
        assert (model.dangers, model.obeyed) == ([], [])
    vesc, port = made(Stranger(b"\x0c\x01\xf4" * 5))
    with pytest.raises(DriverError):
        vesc.connect()
    frames = FrameReceiver().feed(bytes(port.written))
    assert {frame.payload for frame in frames} == {b"\0"}


def test_of_two_threads_that_write_one_waits() -> None:
    """Else a question could fall in the middle of a command."""
    writes: list[str] = []

    class Slow(ModelPort):
        def write(self, data: bytes) -> None:
            writes.append("begin")
            if len(writes) == 1:
                other.start()
                other.join(0.1)
            super().write(data)
            writes.append("end")

    shared = ReadChannel(Slow(Stranger()))
    other = threading.Thread(target=shared.ask, args=(ASK_SETUP,))
    shared.ask(ASK_SETUP)
    other.join(10)
    assert writes == ["begin", "end"] * 2


def test_a_logger_has_no_way_to_say_anything_else() -> None:
    """By construction: one place writes to the port, and a read channel hands it questions only."""
    writers = [
        module.__name__
        for module in (channel, driver, handshake)
        for node in ast.walk(ast.parse(inspect.getsource(module)))
        if isinstance(node, ast.Attribute) and node.attr == "write"
    ]
    assert writers == [channel.__name__]
    public = {name for name in vars(ReadChannel) if not name.startswith("_")}
    assert public == {"now_ns", "ask", "read", "drain", "close"}
    assert inspect.signature(ReadChannel.ask).parameters["request"].annotation == "ReadRequest"
    private = {"_send"}
    users = [
        node.attr
        for module in (driver, handshake)
        for node in ast.walk(ast.parse(inspect.getsource(module)))
        if isinstance(node, ast.Attribute) and node.attr in private | {"command"}
    ]
    assert users == []
