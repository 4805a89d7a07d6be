from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.vesc import FrameReceiver, encode_frame
from drivers.vesc.framing import MAX_PAYLOAD_BYTES

payloads = st.binary(min_size=1, max_size=MAX_PAYLOAD_BYTES)
short_payloads = st.binary(min_size=1, max_size=80)


def found(receiver: FrameReceiver, data: bytes) -> list[bytes]:
    return [frame.payload for frame in receiver.feed(data)]


@pytest.mark.parametrize(
    ("payload", "frame"),
    [
        # LiamBindle/PyVESC, tests of the packet codec
        (bytes.fromhex("54 65 21"), "02 03 54 65 21 42 92 03"),
        (bytes.fromhex("21 E1 24 20"), "02 04 21 E1 24 20 38 BB 03"),
        # the `vesc` crate of Rust: well framed, of an unknown id
        (bytes.fromhex("DE 04 00"), "02 03 DE 04 00 B2 51 03"),
        # reference B.4, computed: GET_VALUES for the VESC with id 1 on the CAN bus
        (bytes.fromhex("22 01 04"), "02 03 22 01 04 9B 13 03"),
        # the check value of CRC-16/XMODEM
        (b"123456789", "02 09 31 32 33 34 35 36 37 38 39 31 C3 03"),
    ],
)
def test_the_frames_of_independent_programs(payload: bytes, frame: str) -> None:
    assert encode_frame(payload) == bytes.fromhex(frame)
    assert found(FrameReceiver(), bytes.fromhex(frame)) == [payload]


@pytest.mark.parametrize(
    ("size", "start"), [(1, "02 01"), (255, "02 ff"), (256, "03 01 00"), (1024, "03 04 00")]
)
def test_the_length_has_two_bytes_from_256_on(size: int, start: str) -> None:
    frame = encode_frame(bytes(size))
    assert frame.startswith(bytes.fromhex(start))
    assert found(FrameReceiver(), frame) == [bytes(size)]


@pytest.mark.parametrize("size", [0, 1025])
def test_lengths_that_no_vesc_takes(size: int) -> None:
    with pytest.raises(ValueError, match=f"1 to 1024 bytes, not {size}"):
        encode_frame(bytes(size))


@given(st.lists(payloads, max_size=5), st.data())
def test_any_partition_gives_the_same_frames(sent: list[bytes], data: st.DataObject) -> None:
    line = b"".join(map(encode_frame, sent))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(line)), max_size=12)))
    receiver = FrameReceiver()
    pieces = [line[a:b] for a, b in zip([0, *cuts], [*cuts, len(line)], strict=True)]
    assert [payload for piece in pieces for payload in found(receiver, piece)] == sent
    assert (receiver.bad_frames, receiver.bad_bytes) == (0, 0)


@given(st.binary(max_size=300), short_payloads)
def test_after_any_noise_the_next_good_frame_is_found(noise: bytes, payload: bytes) -> None:
    receiver = FrameReceiver()
    frames = found(receiver, noise + encode_frame(payload))
    frames += [frame.payload for frame in receiver.expire()]
    assert frames[-1] == payload
    whole = len(noise) + len(encode_frame(payload))
    assert receiver.bad_bytes == whole - sum(len(encode_frame(each)) for each in frames)


@given(
    st.lists(short_payloads, min_size=1, max_size=4),
    st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 7)), max_size=6),
    st.integers(0, 10_000),
    short_payloads,
)
def test_any_corruption_costs_only_what_it_touched(
    sent: list[bytes], flips: list[tuple[int, int]], lost: int, last: bytes
) -> None:
    line = bytearray(b"".join(map(encode_frame, sent)))
    for at, bit in flips:
        line[at % len(line)] ^= 1 << bit
    del line[lost % len(line)]
    receiver = FrameReceiver()
    frames = found(receiver, bytes(line) + encode_frame(last))
    frames += [frame.payload for frame in receiver.expire()]
    assert frames[-1] == last


def test_one_byte_is_dropped_not_the_whole_of_a_bad_frame() -> None:
    inner = encode_frame(b"inner")
    broken = bytes((2, len(inner))) + inner + b"\0\0\3"  # a good frame in one of a wrong CRC
    receiver = FrameReceiver()
    assert found(receiver, broken) == [b"inner"]
    assert receiver.expire() == []  # its stop may begin a frame
    assert receiver.bad_bytes == len(broken) - len(inner)
    assert receiver.bad_frames >= 1


def test_a_long_frame_of_a_short_length_is_none() -> None:
    """Firmware from 3.48 rejects a start 03 with less than 255 bytes; so it is not waited for."""
    receiver = FrameReceiver()
    assert found(receiver, bytes.fromhex("03 00 05") + encode_frame(b"x")) == [b"x"]
    assert receiver.bad_bytes == 3


def test_what_promises_too_much_is_given_up_when_time_has_passed() -> None:
    receiver = FrameReceiver()
    assert found(receiver, bytes.fromhex("03 04 00") + encode_frame(b"held back")) == []
    assert [frame.payload for frame in receiver.expire()] == [b"held back"]
    assert found(receiver, encode_frame(b"next")) == [b"next"]


def test_a_frame_knows_how_many_bytes_came_after_it() -> None:
    first, second = encode_frame(b"one"), encode_frame(b"three")
    frames = FrameReceiver().feed(first + second + b"\2")
    assert [frame.following for frame in frames] == [len(second) + 1, 1]
