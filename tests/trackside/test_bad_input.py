"""Bad input through the real commands: the error names file, place and remedy; nothing is left.

Each case is a call, and the pieces that the one line of the error must hold.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from trackside import cli

S = 1_000_000_000


class Place:
    """A folder with one good truth, path and map, and what a command says and leaves there."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self._capsys = folder, capsys
        self.write("truth.tum", poses(range(50)))
        self.write("path.tum", poses(range(50)))
        self.write("cones.csv", "id,x,y\n1,1.0,1.0\n2,3.0,-1.0\n")
        header = "id,x,y,sxx,sxy,syy,t_added,x_added,y_added,n_seen\n"
        self.write(
            "map.csv",
            header + "1,1.0,1.0,1e-4,0,1e-4,1.0,0.1,0,9\n2,3.0,-1.0,1e-4,0,1e-4,2.5,2,0,9\n",
        )

    def write(self, name: str, text: str) -> None:
        (self.folder / name).write_text(text)

    def run(self, *words: str) -> tuple[int, str, str]:
        before = self.listing()
        with pytest.raises(SystemExit) as end:
            cli.main(list(words))
        printed = self._capsys.readouterr()
        code = end.value.code
        assert isinstance(code, int)
        if code:
            assert self.listing() == before, "something half-written stayed behind"
        return code, printed.out, printed.err

    def listing(self) -> list[str]:
        return sorted(str(p.relative_to(self.folder)) for p in self.folder.rglob("*"))

    def score(self, *words: str) -> tuple[int, str, str]:
        return self.run(
            "score", "--truth", "truth.tum", "--cones", "cones.csv",
            "--path", "path.tum", "--map", "map.csv", *words,
        )  # fmt: skip


def poses(steps: range, start_s: int = 1000) -> str:
    return "".join(f"{start_s + k * 0.1:.1f} {k * 0.1:.2f} 0 0 0 0 0 1\n" for k in steps)


@pytest.fixture
def place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Place:
    monkeypatch.chdir(tmp_path)
    return Place(tmp_path, capsys)


def test_good_input_is_good(place: Place) -> None:
    code, out, err = place.score("--format", "json")
    assert (code, err) == (0, "")
    assert json.loads(out)["scores"][0]["counts"]["pairs"] == 2


@pytest.mark.parametrize(
    ("file", "content", "told"),
    [
        ("path.tum", "", ("path.tum", "no line of numbers", "8 columns", "written to its end?")),
        ("truth.tum", "# only words\n", ("truth.tum", "no line of numbers")),
        ("cones.csv", "", ("cones.csv", "empty", "id,x,y", "written to its end?")),
        ("map.csv", "", ("map.csv", "empty", "id,x,y")),
        (
            "path.tum",
            poses(range(9)) + "1001.0 x 0 0 0 0 0 1\n",
            ("path.tum:10", "found 'x'", "correct the line"),
        ),
        (
            "path.tum",
            poses(range(9)) + "1001.0 1 0 0\n",
            ("path.tum:10", "4 columns", "expected 8"),
        ),
        ("path.tum", "1 nan 0 0 0 0 0 1\n" * 3, ("path.tum:1", "none of the 3 poses is finite")),
        (
            "path.tum",
            poses(range(20)) + poses(range(4, 5)),
            ("path.tum:21", "line 5", "delete one line"),
        ),
        ("truth.tum", poses(range(20)) + poses(range(4, 5)), ("truth.tum:21", "line 5")),
        (
            "cones.csv",
            "id,x,y\n7,0,0\n8,1,1\n7,2,2\n",
            ("cones.csv:4", "id 7", "line 2", "delete one"),
        ),
        ("map.csv", "id,x,y\n7,0,0\n7,2,2\n", ("map.csv:3", "id 7", "line 2")),
        (
            "map.csv",
            "id,x,y\n7,0,nan\n",
            ("map.csv:2", "landmark 7 is not finite", "delete the line"),
        ),
        (
            "path.tum",
            poses(range(50), 4600),
            (
                "truth 1000.000 to 1004.900 s",
                "10.0 Hz",
                "4600.000",
                "do not overlap",
                "--offset -3600.000",
            ),
        ),
        (
            "truth.tum",
            poses(range(1)),
            ("1 of 50 poses", "the truth is a single pose", "right file?"),
        ),
        (
            "path.tum",
            "".join(f"{k} {k} 0 {k} 0 0 0 1\n" for k in range(20)),
            ("path.tum", "leaves the plane", "--space 3d"),
        ),
    ],
)
def test_a_bad_text_file_is_refused(
    place: Place, file: str, content: str, told: tuple[str, ...]
) -> None:
    place.write(file, content)
    code, out, err = place.score("--report", "report.html", "-o", "score.json")
    assert (code, out) == (1, "")
    assert len(err.splitlines()) == 1, err
    for piece in told:
        assert piece in err, err


def test_poses_that_are_not_finite_are_dropped_and_counted(place: Place) -> None:
    place.write("path.tum", poses(range(50)).replace("1000.3 0.30", "1000.3 nan"))
    code, out, _ = place.score()
    assert code == 0
    assert "note: 1 poses of path.tum were not finite" in out
    assert "poses: 49 paired" in out


def test_the_order_of_the_lines_does_not_matter(place: Place) -> None:
    straight = place.score("--format", "csv")[1]
    lines = poses(range(50)).splitlines(keepends=True)
    np.random.default_rng(0).shuffle(lines)
    place.write("path.tum", "".join(lines))
    assert place.score("--format", "csv")[1] == straight


def test_no_pairs_leave_map_and_distance_undefined(place: Place) -> None:
    place.write("map.csv", "id,x,y,t_added\n1,40,40,2\n")
    code, out, _ = place.score()
    assert code == 0
    assert "q = 0 pairs" in out
    assert "map and distance undefined: no landmarks within 0.3 m" in out
    strict = json.loads(place.score("--strict", "--format", "json")[1])["scores"][0]
    assert strict["total"] is None
    assert strict["errors"]["map"] is None
    assert place.score("--fail-above", "map=1")[0] == 3


def test_no_landmark_after_the_start_leaves_the_distance_undefined(place: Place) -> None:
    place.write("map.csv", "id,x,y,t_added\n1,1,1,1000\n2,3,-1,1000\n")
    code, out, _ = place.score()
    assert code == 0
    assert "q' = 0" in out
    assert "distance undefined: no paired landmark was added after the car moved" in out


def rosbag1(file: Path) -> None:
    """A ROS 1 bag with two odometry messages."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(file) as writer:
        link = writer.add_connection("/vesc/odom", "std_msgs/msg/String", typestore=store)
        text = store.types["std_msgs/msg/String"](data="x" * 5000)
        for k in range(2):
            writer.write(link, k * S, store.serialize_ros1(text, "std_msgs/msg/String"))


def jsonschema_mcap(file: Path) -> None:
    from mcap.writer import Writer

    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="test")
        schema = writer.register_schema("speed", "jsonschema", b"{}")
        channel = writer.register_channel("/speed", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap types it not


def cut(file: Path, make: Callable[[Path], None]) -> None:
    make(file)
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])


def test_a_truncated_bag_is_refused(place: Place) -> None:
    cut(place.folder / "cut.bag", rosbag1)
    code, _, err = place.run("import", "bag", "cut.bag", "-o", "session")
    assert code == 1
    assert "cut.bag: cannot be read as a bag" in err
    assert "rosbag reindex" in err


def test_a_channel_of_another_encoding_is_named(place: Place) -> None:
    jsonschema_mcap(place.folder / "speed.mcap")
    code, _, err = place.run("import", "bag", "speed.mcap", "-o", "session")
    assert code == 1
    assert "speed.mcap" in err
    assert "/speed" in err
    assert "jsonschema" in err
    assert "ros2msg" in err


def test_a_folder_that_cannot_be_read_is_named(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    (place.folder / "closed").mkdir()
    genuine = Path.read_text

    def refused(path: Path, *args: object, **kwargs: object) -> str:
        if "closed" in path.parts:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return genuine(path, *args, **kwargs)  # type: ignore[arg-type]  # passed on as they came

    place.write("closed/session.yaml", "format: 1\n")
    monkeypatch.setattr(Path, "read_text", refused)
    code, _, err = place.run("score", "closed")
    assert code == 1
    assert "closed" in err
    assert "Permission denied" in err
    assert "owner and mode" in err


@pytest.mark.parametrize(
    "words",
    [
        ("import", "tum", "--truth", "truth.tum", "--cones", "cones.csv", "-o", "session"),
        ("score", "--truth", "truth.tum", "--path", "path.tum", "-o", "score.json"),
        ("score", "--truth", "truth.tum", "--path", "path.tum", "--errors", "errors.csv"),
        ("score", "--truth", "truth.tum", "--path", "path.tum", "--report", "report.html"),
    ],
)
def test_a_full_disk_leaves_nothing(
    place: Place, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    code, _, err = place.run(*words)
    assert code == 1
    assert "No space left on device" in err
    assert "MB free" in err
    assert "make room" in err
