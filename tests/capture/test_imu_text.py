from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from capture import TextFileError, read_imu_csv

HEADER = (
    "t,angular_velocity_x_rad_s,linear_acceleration_x_m_s2,angular_velocity_y_rad_s,"
    "linear_acceleration_y_m_s2,angular_velocity_z_rad_s,linear_acceleration_z_m_s2\n"
)


def test_rows_come_in_the_order_of_their_stamps(tmp_path: Path) -> None:
    file = tmp_path / "imu.csv"
    file.write_text(HEADER + "2.5,1,2,3,4,5,6\n1.25,7,8,9,10,11,12\n2.5,0,0,0,0,0,0\n")
    imu = read_imu_csv(file)
    assert imu.t_ns.tolist() == [1_250_000_000, 2_500_000_000]
    np.testing.assert_array_equal(imu.angular_velocity_rad_s, [[7, 9, 11], [1, 3, 5]])
    np.testing.assert_array_equal(imu.linear_acceleration_m_s2, [[8, 10, 12], [2, 4, 6]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER, "holds 0 rows"),
        ("t,a\n1,2\n", "angular_velocity_x_rad_s"),
        (HEADER + "1,1,1,1,1,1,1\n2,1,x,1,1,1,1\n", "imu.csv:3: linear_acceleration_x_m_s2"),
    ],
)
def test_what_is_no_such_table_is_told(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "imu.csv"
    file.write_text(text)
    with pytest.raises(TextFileError, match=words):
        read_imu_csv(file)
