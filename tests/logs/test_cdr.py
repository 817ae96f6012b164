"""CDR against bytes written by hand."""

import pytest

from dualbend.logs.cdr import Decoder, Encoder
from dualbend.logs.messages import joint_state, read_joint_state, stamped

JOINT_STATE = bytes.fromhex(
    "00010000"  # plain CDR, little endian
    "01000000 02000000"  # stamp: 1 s, 2 ns
    "01000000 00"  # frame_id: "", with its NUL
    "000000 02000000"  # two names, aligned to 4
    "02000000 6100"  # "a"
    "0000 03000000 626300"  # "bc"
    "00 02000000"  # two positions
    "000000000000f03f 00000000000000c0"  # 1.0, -2.0
    "00000000"  # no velocity: an empty list aligns nothing
    "00000000"  # no effort
)


def test_a_joint_state_is_written_and_read_by_hand() -> None:
    written = joint_state(1_000_000_002, ("a", "bc"), (1.0, -2.0))
    assert written == JOINT_STATE
    assert read_joint_state(written) == (1_000_000_002, {"a": 1.0, "bc": -2.0})


def test_a_big_endian_message_is_read() -> None:
    """As a machine of the other order writes it."""
    swapped = bytes.fromhex(
        "00000000 00000001 00000002 00000001 00000000 00000001 00000002 6100 0000 00000001"
        "3ff0000000000000 00000000 00000000"
    )
    assert read_joint_state(swapped) == (1_000_000_002, {"a": 1.0})


def test_doubles_after_a_frame_are_aligned() -> None:
    """To 8 bytes from the end of the header."""
    written = stamped(0, "abcd", [0.5])
    frame = bytes.fromhex("05000000 6162636400")
    assert written[4:] == bytes(8) + frame + bytes(7) + bytes.fromhex("000000000000e03f")


@pytest.mark.parametrize("size", range(len(JOINT_STATE) - 8))
def test_a_message_that_is_cut_off_is_refused(size: int) -> None:
    with pytest.raises(ValueError, match=r"."):
        read_joint_state(JOINT_STATE[:size])


def test_a_length_of_the_whole_memory_is_refused() -> None:
    made = Encoder()
    made.count(2**32 - 1)
    with pytest.raises(ValueError, match="longer than its message"):
        Decoder(made.message).list_of_doubles()
