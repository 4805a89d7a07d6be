"""Black shapes at exact places on paper: the little of PDF 1.4 that markers need.

Content streams are left readable, so that sizes can be checked in the file itself. Millimetres,
origin at the lower left of the page. (ISO 32000-1, sections 7 and 8.5.)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

PAPERS_MM = {
    "A4": (210.0, 297.0),
    "A3": (297.0, 420.0),
    "A2": (420.0, 594.0),
    "A1": (594.0, 841.0),
    "A0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
}
POINTS_PER_MM = 72.0 / 25.4
_ARCS = 8


class Page:
    """One page, which is drawn on; sizes in millimetres."""

    def __init__(self, width_mm: float, height_mm: float) -> None:
        self.width_mm, self.height_mm = width_mm, height_mm
        self._lines: list[str] = []

    def disc(self, x: float, y: float, diameter: float, grey: float) -> None:
        """A filled circle of eight curves, off by less than a millionth of its radius."""
        self._lines += [f"{grey:g} g", *_circle(x, y, diameter / 2.0), "f"]

    def circle(self, x: float, y: float, diameter: float, grey: float) -> None:
        """A thin line round a circle."""
        self._lines += [f"{grey:g} G 0.3 w", *_circle(x, y, diameter / 2.0), "s"]

    def bar(self, x: float, y: float, width: float, height: float, grey: float = 0.0) -> None:
        """A filled rectangle with its lower left corner at x, y."""
        self._lines.append(f"{grey:g} g {_points(x, y, width, height)} re f")

    def text(self, x: float, y: float, words: str, size_pt: float = 9.0) -> None:
        """Words in Helvetica, their base line beginning at x, y."""
        safe = words.replace("\\", "\\\\").replace("(", "\\(").replace(")", "\\)")
        self._lines.append(f"0 g BT /F1 {size_pt:g} Tf {_points(x, y)} Td ({safe}) Tj ET")

    @property
    def content(self) -> str:
        """The content stream."""
        return "\n".join(self._lines)


def pdf_bytes(pages: Sequence[Page]) -> bytes:
    """A PDF file of these pages; it asks viewers not to scale when they print."""
    kids = " ".join(f"{4 + 2 * k} 0 R" for k in range(len(pages)))
    objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    for k, page in enumerate(pages):
        box = f"[0 0 {_points(page.width_mm, page.height_mm)}]"
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents {5 + 2 * k} 0 R "
            "/Resources << /Font << /F1 3 0 R >> >> >>"
        )
        objects.append(f"<< /Length {len(page.content)} >>\nstream\n{page.content}\nendstream")
    out, places = b"%PDF-1.4\n", []
    for number, body in enumerate(objects, start=1):
        places.append(len(out))
        out += f"{number} 0 obj\n{body}\nendobj\n".encode("latin-1")
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    size = len(objects) + 1
    tail = f"xref\n0 {size}\n0000000000 65535 f \n{table}trailer\n<< /Size {size} /Root 1 0 R >>\n"
    return out + f"{tail}startxref\n{len(out)}\n%%EOF\n".encode("latin-1")


def _points(*millimetres: float) -> str:
    return " ".join(f"{value * POINTS_PER_MM:.4f}" for value in millimetres)


def _circle(x: float, y: float, radius: float) -> list[str]:
    """Path of a circle: as many cubic curves as arcs (control points at 4/3 tan(arc / 4))."""
    step = 2.0 * np.pi / _ARCS
    reach = 4.0 / 3.0 * np.tan(step / 4.0)

    def at(angle: float, along: float) -> tuple[float, float]:
        c, s = np.cos(angle), np.sin(angle)
        return float(x + radius * (c - along * s)), float(y + radius * (s + along * c))

    lines = [f"{_points(*at(0.0, 0.0))} m"]
    for k in range(_ARCS):
        ends = (*at(k * step, reach), *at((k + 1) * step, -reach), *at((k + 1) * step, 0.0))
        lines.append(f"{_points(*ends)} c")
    return lines
