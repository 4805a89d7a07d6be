"""Who is plugged in: every serial port by the name that it keeps, and who answered there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from drivers.errors import DriverError
from drivers.imu.razor.talk import Talk, recognise
from drivers.port import Port, SerialPort
from drivers.rplidar.conversation import BAUDS, Conversation, find_lidar
from drivers.vesc.channel import ReadChannel
from drivers.vesc.handshake import hear_version

Kind = Literal["lidar", "vesc", "razor"]

USB_IDS: Mapping[str, Kind] = {"10c4:ea60": "lidar", "0483:5740": "vesc", "1b4f:9d0f": "razor"}
"""What stands behind an adapter most likely; it is asked first."""
STABLE = ("/dev/rc", "/dev/serial/by-id", "/dev/serial/by-path")
"""Folders of links in which a port keeps its name, the best one first."""
ASK_S = 4.5
HEARD_S = 0.3
SERIAL = 115200


@dataclass(frozen=True)
class PortFound:
    """A serial port of this machine.

    path : the best name for it in a rig; node : the device behind it, today; maker, usb_id : as
    the USB device says; kind : who answered, None if nobody did; identity : what it said of
    itself; problem : why it could not be asked, or what came instead of an answer.
    """

    path: str
    node: str
    maker: str = ""
    usb_id: str = ""
    kind: Kind | None = None
    identity: Mapping[str, object] = field(default_factory=dict)
    problem: str | None = None


def list_ports() -> tuple[PortFound, ...]:
    """The serial ports on USB and the UARTs of a Jetson's header; nobody is asked yet."""
    from serial.tools.list_ports import comports

    found = []
    for port in sorted(comports(), key=lambda port: str(port.device)):
        if port.vid is None and not str(port.device).startswith("/dev/ttyTHS"):
            continue
        usb_id = "" if port.vid is None else f"{port.vid:04x}:{port.pid:04x}"
        maker = " ".join(filter(None, (port.manufacturer, port.product)))
        found.append(PortFound(stable_path(port.device), port.device, maker, usb_id))
    return tuple(found)


def stable_path(node: str, folders: Sequence[str] = STABLE) -> str:
    """A link to a device that keeps its name when another one is plugged in; else the device."""
    for folder in folders:
        for link in sorted(Path(folder).glob("*")):
            if link.resolve() == Path(node).resolve():
                return str(link)
    return node


def ask_all(
    ports: Sequence[PortFound], open_port: Callable[[str, int], Port] = SerialPort
) -> tuple[PortFound, ...]:
    """The same ports with what answered at each; all are asked at the same time."""
    with ThreadPoolExecutor(max(len(ports), 1)) as pool:
        return tuple(pool.map(lambda port: ask(port, open_port), ports))


def ask(port: PortFound, open_port: Callable[[str, int], Port] = SerialPort) -> PortFound:
    """The port with who answered there. Only questions are sent; nothing starts to move.

    The likeliest kind is asked first. Never raises: a port that cannot be asked says why.
    """
    problems: list[str] = []
    for kind in _order(port, open_port, problems):
        try:
            identity = _QUESTIONS[kind](port.path, open_port)
        except DriverError as err:
            problems.append(str(err))
        else:
            return replace(port, kind=kind, identity=identity)
    return replace(port, problem=problems[0] if problems else "nobody answered")


def _order(
    port: PortFound, open_port: Callable[[str, int], Port], problems: list[str]
) -> list[Kind]:
    """Whom to ask, in this order; nobody where the port cannot be opened."""
    guess = USB_IDS.get(port.usb_id)
    try:
        talks = _streams_lines(port.path, open_port)
    except DriverError as err:
        problems.append(str(err))
        return []
    # A Razor is asked by keys that change it, so only where something speaks for one.
    kinds: list[Kind] = ["razor"] if talks or guess == "razor" else []
    kinds += ["vesc", "lidar"] if guess != "lidar" else ["lidar", "vesc"]
    return kinds


def _streams_lines(path: str, open_port: Callable[[str, int], Port]) -> bool:
    """Whether lines of text come unasked, as from a Razor."""
    port = open_port(path, SERIAL)
    try:
        heard, end_ns = b"", port.now_ns() + round(HEARD_S * 1e9)
        while (left_ns := end_ns - port.now_ns()) > 0:
            chunk = port.read(left_ns * 1e-9)
            heard += chunk.data if chunk is not None else b""
    finally:
        port.close()
    return heard.count(b"\n") >= 2 and heard.isascii()


def _lidar(path: str, open_port: Callable[[str, int], Port]) -> Mapping[str, object]:
    port = open_port(path, SERIAL)
    try:
        talk = Conversation(port, port.now_ns() + round(ASK_S * 1e9))
        baud, info = find_lidar(talk, port, BAUDS)
    finally:
        port.close()
    return {
        "model": info.model_name,
        "firmware": "{}.{:02d}".format(*info.firmware),
        "serial": info.serial,
        "baud": baud,
    }


def _vesc(path: str, open_port: Callable[[str, int], Port]) -> Mapping[str, object]:
    channel = ReadChannel(open_port(path, SERIAL))
    try:
        firmware = hear_version(channel, f"VESC on {path}")
    finally:
        channel.close()
    return {"model": f"VESC {firmware.hardware}".strip(), "firmware": str(firmware)}


def _razor(path: str, open_port: Callable[[str, int], Port]) -> Mapping[str, object]:
    port = open_port(path, SERIAL)
    try:
        firmware, baud = recognise(Talk(port, ASK_S))
    finally:
        port.close()
    return {"model": "Razor IMU M0", "firmware": firmware.value, "baud": baud or "USB"}


_QUESTIONS: Mapping[Kind, Callable[[str, Callable[[str, int], Port]], Mapping[str, object]]] = {
    "lidar": _lidar,
    "vesc": _vesc,
    "razor": _razor,
}
