"""What is taken from the network, and what is not."""

from __future__ import annotations

import datetime
import os
import pickle
from collections import OrderedDict, deque
from dataclasses import dataclass
from typing import Any

import pytest

from mavproxy_uavapi.aerpaw import wire
from mavproxy_uavapi.aerpaw.geometry import Coordinate, VectorNED


@dataclass
class OfTheScript:
    number: int


class Evil:
    def __reduce__(self) -> Any:
        return os.system, ("true",)


def as_sent(value: Any) -> bytes:
    """As a peer writes it; the module that a peer has by that name need not be here."""
    return pickle.dumps({"value": value})


def place(kind: str) -> bytes:
    """A place or vector as aerpawlib pickles it: the name of its class there, and its attributes."""
    members = "}(Vnorth\nI1\nVeast\nI2\nVdown\nI3\nVlat\nF1.5\nVlon\nF2.5\nValt\nF3.5\nub"
    return f"(dVvalue\ncaerpawlib.v1.util.geometry\n{kind}\n)\x81{members}s.".encode("latin-1")


def test_places_of_peers_are_places_here() -> None:
    value = wire.read(place("Coordinate"), "mission")["value"]
    assert type(value) is Coordinate and (value.lat, value.lon, value.alt) == (1.5, 2.5, 3.5)
    assert type(wire.read(place("VectorNED"), "mission")["value"]) is VectorNED


@pytest.mark.parametrize(
    "value", [None, 1.5, "text", [1, {"a": (2, 3)}], {1, 2}, datetime.datetime(2026, 1, 2), datetime.timedelta(1)]
)
def test_plain_data_is_taken(value: Any) -> None:
    assert wire.read(as_sent(value), "mission") == {"value": value}


@pytest.mark.parametrize("protocol", [3, 4, 5])
@pytest.mark.parametrize(
    "value", [frozenset({1}), set(), OrderedDict(a=1), deque([1, 2]), deque([1, 2], 5), bytearray(b"x"), bytearray()]
)
def test_containers_are_taken_with_their_contents(value: Any, protocol: int) -> None:
    taken = wire.read(pickle.dumps({"value": value}, protocol), "mission")["value"]
    assert (type(taken), taken) == (type(value), value)


@pytest.mark.parametrize("protocol", [3, 4, 5])
def test_arrays_are_taken(protocol: int) -> None:
    numpy = pytest.importorskip("numpy")
    array, word = numpy.arange(6.0).reshape(1, 2, 3), numpy.array(["a", "bc"])
    for one in (array, array.T, array.transpose(2, 0, 1), array[:, ::2], word, numpy.float32(1.5)):
        taken = wire.read(pickle.dumps({"value": one}, protocol), "mission")["value"]
        assert (taken.dtype, taken.tolist()) == (one.dtype, one.tolist())


class Calls:
    """What is pickled as a call of a function."""

    def __init__(self, function: Any, *args: Any) -> None:
        self.call = function, args

    def __reduce__(self) -> Any:
        return self.call


def test_few_bytes_do_not_become_many() -> None:
    numpy = pytest.importorskip("numpy")
    huge = Calls(numpy.ndarray, (10**7,), "b")
    for one in (
        Calls(deque, Calls(range, 10**7), 0),
        Calls(bytearray, 10**7),
        huge,
        Calls(deque, huge, 0),
        Calls(numpy._core.numeric._frombuffer, huge, numpy.dtype("b"), (10**7,), "C"),
        Calls(numpy._core.numeric._frombuffer, b"12345678", numpy.dtype("b"), (10**7,), "C"),
        Calls(numpy._core.numeric._frombuffer, bytes(8), numpy.dtype("O"), (1,), "C"),
        Calls(set, "text"),
    ):
        with pytest.raises(ValueError, match=r"not accepted|damaged"):
            wire.read(as_sent(one), "mission")


def test_classes_of_the_script_itself_are_taken() -> None:
    assert wire.read(as_sent(OfTheScript(3)), __name__)["value"] == OfTheScript(3)
    with pytest.raises(ValueError, match="OfTheScript"):
        wire.read(as_sent(OfTheScript(3)), "another_script")


@pytest.mark.parametrize("data", [as_sent(Evil()), as_sent(print), b"", b"nonsense", pickle.dumps([1]), b"\x80\x05."])
def test_what_runs_anything_or_makes_no_sense_is_not_taken(data: bytes) -> None:
    with pytest.raises(ValueError, match="."):
        wire.read(data, __name__)


@pytest.mark.parametrize("name", ["os.system", "Evil", "os"])
def test_what_the_script_has_imported_is_not_its_own(name: str) -> None:
    data = b"(dVvalue\nc" + f"{__name__}\n{name}".encode() + b"\ns."
    if name == "Evil":
        assert wire.read(data, __name__)["value"] is Evil
        return
    with pytest.raises(ValueError, match="not accepted"):
        wire.read(data, __name__)


@pytest.mark.parametrize(
    "data",
    [
        b"\x80\x05\x96\x00\x00\x00\x00\x01\x00\x00\x00abc.",  # a bytearray of 4 GiB
        b"\x80\x04}r\x00\x00\x00\x01.",  # the memo's place 16,777,216
        b"}p16777216\n.",
    ],
)
def test_a_few_bytes_that_ask_for_much_room_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="is not accepted from the network|damaged"):
        wire.read(data, "mission")
