"""The browser finds what is wrong with a page: otherwise the tests of our pages prove nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from browser import Browser, faults

GOOD = "<p>a text</p><div style='overflow-x: auto'><div style='width: 900px'>scrolls</div></div>"


def page(folder: Path, body: str) -> Path:
    file = folder / "page.html"
    head = "<meta charset=utf-8><style>:root { color-scheme: light dark }</style>"
    file.write_text(f"<!doctype html>{head}<title>x</title><body>{body}")
    return file


def test_a_page_that_stands_alone_has_no_faults(browser: Browser, tmp_path: Path) -> None:
    assert faults(browser, page(tmp_path, GOOD)) == []


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("<img src='http://example.org/a.png' alt=''>", "asks for http://example.org/a.png"),
        ("<img src='beside.png' alt=''>", "/beside.png"),
        ("<style>@import 'https://example.org/x.css'</style>", "https://example.org/x.css"),
        ("<script>fetch('//example.org/late')</script>", "asks for file://example.org/late"),
        ("<script>console.warn('so so')</script>", "so so"),
        ("<script>nothing()</script>", "nothing is not defined"),
        ("<div style='width: 500px'>wide</div>", "390 px light: past the edge: div.: wide"),
        ("<p style='color: #888; background: #fff'>grey</p>", "faint, 3.54 < 4.5: grey"),
        ("<p style='opacity: .4'>thin</p>", "1280 px dark: faint"),
        ("<svg width=90 height=20><text y=15 fill='#bbb'>drawn</text></svg>", "light: faint"),
    ],
)
def test_what_is_wrong_is_told(browser: Browser, tmp_path: Path, body: str, told: str) -> None:
    found = faults(browser, page(tmp_path, body))
    assert any(told in fault for fault in found), found


def test_a_page_that_is_not_there_is_no_page_without_faults(
    browser: Browser, tmp_path: Path
) -> None:
    with pytest.raises(FileNotFoundError):
        browser.look(tmp_path / "nowhere.html", 390)


def test_light_dark_and_width_are_what_was_asked_for(browser: Browser, tmp_path: Path) -> None:
    script = """<p></p><script>document.querySelector("p").textContent = innerWidth + " " +
    matchMedia("(prefers-color-scheme: dark)").matches</script>"""
    file = page(tmp_path, script)
    for width, dark in [(1280, True), (390, False)]:
        look = browser.look(file, width, dark=dark)
        assert f"<p>{width} {str(dark).lower()}</p>" in look.dom
        assert look.png.startswith(b"\x89PNG")
        # A PNG holds its width in bytes 16 to 20.
        assert int.from_bytes(look.png[16:20], "big") == width
