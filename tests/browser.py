"""A headless Chromium that opens a page of ours and tells what a person would meet there.

Chromium's own driver speaks plain HTTP on the loopback (W3C WebDriver, with Chrome's `goog/cdp`
beside it), so nothing but the standard library is needed. Tests get one as the fixture `browser`,
which skips where Debian's `chromium` and `chromium-driver` are not installed.
"""

from __future__ import annotations

import base64
import http.client
import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PROGRAMS = ("chromedriver", "chromium")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--hide-scrollbars",
    # Whatever a page asks for is listed all the same, and gets nowhere.
    "--host-resolver-rules=MAP * ~NOTFOUND",
)
_STARTED = re.compile(rb"started successfully on port (\d+)")
_SCRIPT = Path(__file__).with_name("browser.js")


def missing_programs() -> list[str]:
    """The programs that a browser needs and that are not installed."""
    return [name for name in PROGRAMS if shutil.which(name) is None]


@dataclass(frozen=True)
class Faint:
    """A text that stands out too little: its words, its contrast and what WCAG 2 asks for."""

    text: str
    contrast: float
    needed: float


@dataclass(frozen=True)
class Look:
    """What came of opening a page.

    console : messages of level warning and error; requests : every address that was asked for, the
    page's own included, without `data:`, which asks nobody; overflow : elements that reach past the
    right edge of the window and are not in a box that scrolls; faint : texts below the contrast of
    WCAG 2, level AA; dom : the page after its scripts; png : the whole page.
    """

    console: tuple[str, ...]
    requests: tuple[str, ...]
    overflow: tuple[str, ...]
    faint: tuple[Faint, ...]
    dom: str
    png: bytes


class Browser:
    """One Chromium with a new profile; `close` ends it."""

    def __init__(self) -> None:
        self._profile = tempfile.mkdtemp(prefix="trackside-chromium-")
        self._driver = subprocess.Popen(
            ["chromedriver", "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        try:
            self._port = self._driver_port()
            self._session = ""
            options = {
                "args": [*FLAGS, f"--user-data-dir={self._profile}"],
                "binary": shutil.which("chromium"),
                "perfLoggingPrefs": {"enableNetwork": True, "enablePage": False},
            }
            wanted = {
                "browserName": "chrome",
                "goog:chromeOptions": options,
                "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
            }
            answer = self._call("POST", "", {"capabilities": {"alwaysMatch": wanted}})
            self._session = f"/{answer['sessionId']}"
        except BaseException:
            self._end_driver()
            raise

    def look(self, page: Path, width: int, *, dark: bool = False, height: int = 900) -> Look:
        """Open a file `width` CSS pixels wide, for a reader who prefers light or dark pages."""
        if not page.is_file():  # Chromium would show a page of its own, which has no faults
            raise FileNotFoundError(page)
        self._cdp("Network.setCacheDisabled", cacheDisabled=True)
        screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._cdp("Emulation.setDeviceMetricsOverride", **screen)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._cdp("Emulation.setEmulatedMedia", features=[scheme])
        self._call("POST", "/url", {"url": "about:blank"})
        self._console(), self._requests()
        self._call("POST", "/url", {"url": page.resolve().as_uri()})
        found = self._run(_SCRIPT.read_text(encoding="utf-8"))
        shot = self._cdp("Page.captureScreenshot", format="png", captureBeyondViewport=True)
        return Look(
            console=self._console(),
            requests=self._requests(),
            overflow=tuple(found["overflow"]),
            faint=tuple(Faint(**text) for text in found["faint"]),
            dom=found["dom"],
            png=base64.b64decode(shot["data"]),
        )

    def close(self) -> None:
        """End Chromium and its driver, and forget the profile."""
        try:
            self._call("DELETE", "")
        finally:
            self._end_driver()

    def _end_driver(self) -> None:
        self._driver.terminate()
        self._driver.communicate(timeout=20)
        shutil.rmtree(self._profile, ignore_errors=True)

    def _driver_port(self) -> int:
        """The port that the driver chose; it names it on its first lines."""
        assert self._driver.stdout is not None
        said = b""
        for line in self._driver.stdout:
            said += line
            if found := _STARTED.search(line):
                return int(found[1])
        raise RuntimeError(f"chromedriver ended before it listened: {said.decode()}")

    def _call(self, method: str, where: str, body: Mapping[str, object] | None = None) -> Any:
        """One command of WebDriver and the value of its answer."""
        link = http.client.HTTPConnection("127.0.0.1", self._port, timeout=60)
        try:
            text = None if body is None else json.dumps(body)
            link.request(method, f"/session{self._session}{where}", text)
            answer = json.loads(link.getresponse().read())["value"]
        finally:
            link.close()
        if isinstance(answer, dict) and "error" in answer:
            raise RuntimeError(f"{method} {where}: {answer['error']}: {answer['message']}")
        return answer

    def _cdp(self, command: str, **parameters: object) -> Any:
        return self._call("POST", "/goog/cdp/execute", {"cmd": command, "params": parameters})

    def _run(self, script: str) -> Any:
        """What a script gives; a promise is waited for."""
        return self._call("POST", "/execute/sync", {"script": script, "args": []})

    def _console(self) -> tuple[str, ...]:
        entries = self._call("POST", "/se/log", {"type": "browser"})
        return tuple(e["message"] for e in entries if e["level"] in ("WARNING", "SEVERE"))

    def _requests(self) -> tuple[str, ...]:
        entries = self._call("POST", "/se/log", {"type": "performance"})
        events = [json.loads(entry["message"])["message"] for entry in entries]
        sent = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
        addresses = [event["request"]["url"] for event in sent]
        return tuple(address for address in addresses if not address.startswith("data:"))


def faults(browser: Browser, page: Path) -> list[str]:
    """What is wrong with a page that shall stand alone: at a desk, on a phone, light and dark."""
    found = []
    for width, dark in [(1280, False), (1280, True), (390, False), (390, True)]:
        look = browser.look(page, width, dark=dark)
        here = f"{width} px {'dark' if dark else 'light'}: "
        found += [f"{here}console: {message}" for message in look.console]
        found += [
            f"{here}asks for {url}" for url in look.requests if url != page.resolve().as_uri()
        ]
        found += [f"{here}past the edge: {element}" for element in look.overflow]
        found += [f"{here}faint, {t.contrast} < {t.needed}: {t.text}" for t in look.faint]
    return found
