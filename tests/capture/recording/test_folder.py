from __future__ import annotations

import datetime
from pathlib import Path

import pytest

from capture.errors import LogError, SessionError
from capture.recording.folder import held, new_recording_folder
from dialogue import UsageError

DAY = datetime.date(2026, 5, 14)


def test_trials_are_counted_up_for_each_map_and_power(tmp_path: Path) -> None:
    def name(map_name: str, power: str = "") -> str:
        return new_recording_folder(tmp_path, DAY, map_name, power)[0].name

    assert name("turn", "low") == "2026-05-14_turn_low_1"
    assert name("turn", "low") == "2026-05-14_turn_low_2"
    assert name("turn", "high") == "2026-05-14_turn_high_1"
    assert name("loop") == "2026-05-14_loop_1"


def test_a_trial_is_one_number_on_the_car_and_beside_the_track(tmp_path: Path) -> None:
    (tmp_path / "2026-05-13_turn_low_7_film").mkdir()
    (tmp_path / "2026-05-13_turn_lower_9").mkdir()
    folder, trial = new_recording_folder(tmp_path, DAY, "turn", "low", suffix="film")
    assert (folder.name, trial) == ("2026-05-14_turn_low_8_film", 8)


def test_a_trial_that_exists_is_refused(tmp_path: Path) -> None:
    new_recording_folder(tmp_path, DAY, "turn", "low", 3)
    with pytest.raises(SessionError, match="exists already"):
        new_recording_folder(tmp_path, DAY, "turn", "low", 3)


@pytest.mark.parametrize("word", ["", "..", "a/b", "with blank", "-x", "a_b"])
def test_a_map_has_a_name_that_a_folder_can_have(tmp_path: Path, word: str) -> None:
    if not word:
        assert new_recording_folder(tmp_path, DAY, "turn", word)[0].name == "2026-05-14_turn_1"
        return
    with pytest.raises(UsageError, match="letters, digits"):
        new_recording_folder(tmp_path, DAY, word)


def test_a_base_that_is_a_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(LogError, match="cannot write"):
        new_recording_folder(tmp_path / "file", DAY, "turn")


def test_a_folder_is_held_by_one(tmp_path: Path) -> None:
    with held(tmp_path), pytest.raises(SessionError, match="being recorded"), held(tmp_path):
        pass
    with held(tmp_path):
        pass
