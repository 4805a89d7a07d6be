"""What is promised on five real robots, through the benchmark that prints it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parent.parent.parent


@pytest.mark.realdata
@pytest.mark.slow
def test_five_real_robots_are_mapped_as_well_as_promised(data_dir: Path) -> None:
    script = REPOSITORY / "benchmarks" / "mrclam.py"
    command = [sys.executable, str(script), str(data_dir / "mrclam")]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    lines = printed.splitlines()
    for figure in ("mean path", "worst path", "mean map"):
        row = next(line for line in lines if line.startswith(f"| {figure} "))
        assert "| met |" in row, printed
    robots = [line.split("|") for line in lines if line.startswith("| robot ")]
    assert len(robots) == 5
    for cells in robots:
        assert [cell.strip() for cell in cells[6:9]] == ["15 of 15", "0", "0"], printed
