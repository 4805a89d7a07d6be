"""What the curves of the page of a truth show, and what they must not."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from tracking.track_page import _plot_known


def test_no_line_is_drawn_where_nothing_was_seen() -> None:
    axes = Figure().add_subplot()
    t_s, rows = np.arange(6) / 30.0, np.array([0, 1, 4, 5])
    _plot_known(axes, t_s, rows, np.array([1.0, 2.0, 3.0, 4.0]))
    (line,) = axes.lines
    np.testing.assert_array_equal(line.get_xdata(), t_s)
    np.testing.assert_array_equal(line.get_ydata(), [1.0, 2.0, np.nan, np.nan, 3.0, 4.0])
