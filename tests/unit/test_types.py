"""Records: what the standard library's functions for dataclasses, and msgspec, make of them."""

import copy
import dataclasses
import gc
import pickle

import msgspec
import pytest

from asvhil import types
from asvhil.types import Frame, Heading, TrueWind, changed, record

FRAME = Frame(t_ns=5, port="autopilot", data=b"\xfd")
PLAIN = dataclasses.make_dataclass("Frame", [(f.name, f.type) for f in dataclasses.fields(Frame)])


def test_the_functions_for_dataclasses_take_a_record() -> None:
    values = {"t_ns": 5, "port": "autopilot", "data": b"\xfd", "peer": "", "via": ""}
    assert dataclasses.is_dataclass(Frame) and dataclasses.asdict(FRAME) == values
    assert dataclasses.replace(FRAME, peer="a") == changed(FRAME, peer="a") == Frame(**{**values, "peer": "a"})
    assert repr(FRAME) == repr(PLAIN(**values))
    assert msgspec.json.encode(FRAME) == msgspec.json.encode(PLAIN(**values))


def test_a_record_is_frozen_compared_by_value_and_hashable() -> None:
    with pytest.raises(AttributeError):
        FRAME.port = "operator"  # type: ignore[misc]
    with pytest.raises(AttributeError):
        FRAME.other = 1  # type: ignore[attr-defined]
    with pytest.raises(TypeError):
        Frame(5, "autopilot", b"")  # type: ignore[misc]
    assert FRAME == copy.deepcopy(FRAME) == pickle.loads(pickle.dumps(FRAME)) != changed(FRAME, t_ns=6)
    assert len({FRAME, copy.copy(FRAME), changed(FRAME, t_ns=6)}) == 2
    assert Heading(t_ns=1, psi_rad=2.0) != TrueWind(t_ns=1, vn_mps=2.0, ve_mps=0.0)


def test_methods_properties_checks_and_patterns_work() -> None:
    @record
    class Share:
        """A part."""

        of: str
        value: float = 0.5

        def __post_init__(self) -> None:
            if not 0.0 <= self.value <= 1.0:
                raise ValueError("a share is 0 to 1")

        @property
        def rest(self) -> float:
            return 1.0 - self.value

        @classmethod
        def whole(cls) -> "Share":
            return cls(of="all", value=1.0)

    assert Share(of="x").rest == 0.5 and Share.whole().rest == 0.0 and Share.__doc__ == "A part."
    with pytest.raises(ValueError, match="0 to 1"):
        Share(of="x", value=2.0)
    match Share.whole():
        case Share(of="all", value=value):
            assert value == 1.0
        case _:
            pytest.fail("not matched")


def test_the_garbage_collector_does_not_look_at_records() -> None:
    assert not gc.is_tracked(FRAME)


def test_a_record_takes_no_field_of_dataclasses_for_a_default() -> None:
    with pytest.raises(TypeError, match=r"Wrong: a record has no dataclasses\.field"):

        @record
        class Wrong:
            errors: dict[str, str] = dataclasses.field(default_factory=dict)


def test_every_record_of_the_boundary_says_what_it_is() -> None:
    found = [kind for kind in vars(types).values() if isinstance(kind, type) and dataclasses.is_dataclass(kind)]
    assert len(found) > 20 and all(kind.__doc__ for kind in found)
