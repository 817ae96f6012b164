"""RSI's telegrams against bytes written by hand, and what is no telegram."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from dualbend.control.alter import turn
from dualbend.serve.robot.telegram import (
    configuration,
    decode,
    deviation_of,
    encode,
    pose_of,
)

SENT = (
    b'<Rob Type="KUKA">'
    b'<RIst X="-400.500000" Y="0.000000" Z="1250.000000" A="0.000000" B="30.000000" C="0.000000"/>'
    b'<RSol X="-400.000000" Y="0.000000" Z="1250.000000" A="0.000000" B="29.500000" C="0.000000"/>'
    b'<AIPos A1="10.000000" A2="-20.000000"/>'
    b'<RRead A="0.000000" B="29.900000" C="0.000000"/>'
    b'<Delay D="3"/><IPOC>123645634</IPOC></Rob>'
)
ANSWER = (
    b'<Sen Type="ImFree"><EStr>free text</EStr>'
    b'<RKorr X="0.5" Y="0" Z="-1e-1" A="0.0000" B="+.25" C="0"/>'
    b"<DiO>125</DiO><IPOC>123645634</IPOC></Sen>"
)


def test_what_the_robot_sends_is_written_by_hand() -> None:
    measured = np.array([-0.4005, 0.0, 1.25, 0.0, np.radians(30.0), 0.0])
    nominal = np.array([-0.4, 0.0, 1.25, 0.0, np.radians(29.5), 0.0])
    turned = np.array([0.0, np.radians(29.9), 0.0])
    assert encode(measured, nominal, np.array([10.0, -20.0]), 3, 123645634, turned) == SENT
    ET.fromstring(SENT)


def test_an_answer_written_by_hand_is_read() -> None:
    found = decode(ANSWER)
    assert found is not None
    assert found[0] == 123645634
    np.testing.assert_array_equal(found[1], [0.5e-3, 0.0, -0.1e-3, 0.0, np.radians(0.25), 0.0])


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"<Sen></Sen>",
        ANSWER[:-1],
        ANSWER.replace(b"<Sen", b"<Rob"),
        ANSWER.replace(b"123645634", b"12 3"),
        ANSWER.replace(b"123645634", b"-4"),
        ANSWER.replace(b"<IPOC>", b"<IPOC>1</IPOC><IPOC>"),
        ANSWER.replace(b"<DiO>", b'<RKorr X="1"/><DiO>'),
        ANSWER.replace(b'Y="0"', b'X="0"'),
        ANSWER.replace(b'Y="0"', b'Y="nan"'),
        ANSWER.replace(b'Y="0"', b'Y="1e999"'),
        ANSWER.replace(b'Y="0"', b'Y="1_0"'),
        ANSWER.replace(b'Y="0"', b'Y=""'),
        ANSWER.replace(b'Y="0"', b'Q="0"'),
        b'<!DOCTYPE s [<!ENTITY a "a">]>' + ANSWER,
        ANSWER.replace(b"free text", b"<!--&a;-->"),
    ],
)
def test_what_is_no_answer_is_none(data: bytes) -> None:
    assert decode(data) is None


def test_mutated_answers_are_read_or_refused() -> None:
    """Nothing raises; what is read is finite and has a number of a cycle."""
    rng, read = np.random.default_rng(17), 0
    for _ in range(4000):
        data = bytearray(ANSWER)
        for _ in range(rng.integers(1, 5)):
            at = int(rng.integers(len(data)))
            match rng.integers(4):
                case 0:
                    data[at] = int(rng.integers(256))
                case 1:
                    del data[at : at + int(rng.integers(1, 9))]
                case 2:
                    data[at:at] = data[at : at + int(rng.integers(1, 40))]
                case _:
                    data[at:at] = rng.bytes(int(rng.integers(1, 9)))
        found = decode(bytes(data))
        if found is not None:
            read += 1
            assert found[0] >= 0
            assert np.isfinite(found[1]).all()
    assert 200 < read < 3800  # both happen


def test_angles_are_kukas_order_of_axes() -> None:
    """R_z(A) R_y(B) R_x(C), against a product of SciPy's."""
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    angles = [12.0, -34.0, 7.0]
    wanted = rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    deviation = deviation_of([0.0, 0.0, 0.0, *angles])
    np.testing.assert_allclose(turn(deviation[3:]), wanted, atol=1e-14)
    np.testing.assert_allclose(pose_of(deviation)[3:], angles, atol=1e-12)


def test_the_configuration_names_the_port_and_what_is_exchanged() -> None:
    root = ET.fromstring(configuration("192.168.1.2", 49152))
    assert root.findtext("CONFIG/IP_NUMBER") == "192.168.1.2"
    assert root.findtext("CONFIG/PORT") == "49152"
    sent = ET.fromstring(SENT)
    for element in root.iterfind("SEND/ELEMENTS/ELEMENT"):
        name, _, axis = element.attrib["TAG"].removeprefix("DEF_").partition(".")
        found = sent.find(name)
        assert found is not None
        assert not axis or axis in found.attrib
    received = [e.attrib["TAG"] for e in root.iterfind("RECEIVE/ELEMENTS/ELEMENT")]
    assert received == [f"RKorr.{axis}" for axis in "XYZABC"]
