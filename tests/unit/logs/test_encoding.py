"""Outputs as logged: every field back to the bit, floats that are not finite, and the first difference."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asvhil.errors import LogError
from asvhil.logs import encoding
from asvhil.logs.encoding import decode_outputs, encode_outputs, first_difference
from asvhil.types import DockingWindow, EnergyUse, Outputs
from tests.support.log_samples import sample_outputs


def with_cost(cost: float) -> Outputs:
    outputs = sample_outputs(1)
    return dataclasses.replace(outputs, control=dataclasses.replace(outputs.control, cost=cost))


def with_u(u_mps: float, outputs: Outputs | None = None) -> Outputs:
    outputs = outputs or sample_outputs(1)
    return dataclasses.replace(outputs, estimate=dataclasses.replace(outputs.estimate, u_mps=u_mps))


def with_reason(reason: str) -> Outputs:
    outputs = sample_outputs(1)
    return dataclasses.replace(outputs, health=dataclasses.replace(outputs.health, reason=reason))


@pytest.mark.parametrize("control", [True, False])
@pytest.mark.parametrize("sent", [0, 3])
def test_outputs_come_back_equal_and_their_bytes_are_stable(control: bool, sent: int) -> None:
    outputs = sample_outputs(5, control, sent)
    data = encode_outputs(outputs)
    assert decode_outputs(data) == outputs
    assert encode_outputs(decode_outputs(data)) == data


def test_record_starts_as_written_here() -> None:
    data = encode_outputs(sample_outputs(0))
    assert data.startswith(
        b'{"t_ns":1790000000123456789,"phase":"hold","frames":[{"t_ns":1790000000123456789,"port":"autopilot",'
        b'"data":"AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwd","peer":"","via":""}],"estimate":{'
    )
    assert b'"v_mps":-0.0,' in data
    assert b'"n_m":0.3333333333333333,' in data


def test_finite_outputs_take_the_fast_way_whatever_is_absent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(encoding, "_spell_non_finite", None)
    outputs = sample_outputs(1)
    closed, unknown = DockingWindow(open_s=None), EnergyUse(power_w=1.0 / 3.0, by="curve")
    partly = dataclasses.replace(outputs, docking=closed, energy=unknown)
    for record in (outputs, partly, sample_outputs(2, control=False)):
        assert decode_outputs(encode_outputs(record)) == record
    with pytest.raises(TypeError):
        encode_outputs(with_cost(math.nan))


@given(st.floats())
def test_any_float_survives(value: float) -> None:
    read = decode_outputs(encode_outputs(with_u(value))).estimate.u_mps
    assert (math.isnan(read) and math.isnan(value)) or (
        read == value and math.copysign(1.0, read) == math.copysign(1.0, value)
    )


@given(st.text(st.characters(codec="utf-8")), st.sampled_from([1.0, math.nan]))
@settings(max_examples=50)
def test_any_text_survives_beside_any_float(reason: str, u_mps: float) -> None:
    read = decode_outputs(encode_outputs(with_u(u_mps, with_reason(reason))))
    assert read.health.reason == reason
    assert math.isnan(read.estimate.u_mps) == math.isnan(u_mps)


@pytest.mark.parametrize(
    ("value", "text"), [(math.nan, b'"NaN"'), (math.inf, b'"Infinity"'), (-math.inf, b'"-Infinity"')]
)
def test_non_finite_floats_are_spelt_out(value: float, text: bytes) -> None:
    data = encode_outputs(with_cost(value))
    assert b'"cost":' + text + b"," in data
    # The other fields must not depend on which of the two ways of encoding was taken.
    assert data.replace(text, b"1.5") == encode_outputs(with_cost(1.5))
    assert encode_outputs(decode_outputs(data)) == data


def test_non_finite_beside_absent_parts() -> None:
    outputs = with_u(math.nan, sample_outputs(1, control=False))
    read = decode_outputs(encode_outputs(outputs))
    assert math.isnan(read.estimate.u_mps)
    assert read.control is None and read.wind is None and read.pwm_us is None


@pytest.mark.parametrize("reason", ["null", "NaN", "Infinity", "a null, a NaN"])
def test_texts_that_look_like_numbers_stay_texts(reason: str) -> None:
    assert decode_outputs(encode_outputs(with_reason(reason))).health.reason == reason


def test_numpy_scalars_are_recorded_as_the_numbers_they_are() -> None:
    plain = with_u(0.1)
    assert encode_outputs(with_u(np.float64(0.1))) == encode_outputs(plain)
    assert b'"u_mps":"NaN"' in encode_outputs(with_u(np.float64("nan")))


def test_what_json_cannot_hold_is_refused() -> None:
    with pytest.raises(TypeError, match="object"):
        encode_outputs(with_u(object()))  # type: ignore[arg-type]


@pytest.mark.parametrize("data", [b"", b"{", b"[]", b'{"t_ns": 1}', b"\xff\xfe"])
def test_bad_records_are_log_errors(data: bytes) -> None:
    with pytest.raises(LogError, match="outputs record"):
        decode_outputs(data)


def test_bad_field_is_named() -> None:
    data = encode_outputs(sample_outputs(1)).replace(b'"hold"', b'"sailing"')
    with pytest.raises(LogError, match=r"sailing.*phase"):
        decode_outputs(data)


# --- first_difference ---


def test_equal_records_have_no_difference() -> None:
    data = encode_outputs(sample_outputs(1))
    assert first_difference(data, bytes(data)) is None


def test_first_field_that_differs_is_named_with_both_values() -> None:
    recorded, replayed = encode_outputs(with_u(0.12)), encode_outputs(with_u(0.13))
    assert first_difference(recorded, replayed) == "estimate.u_mps: 0.12 recorded, 0.13 replayed"


def test_differences_in_lists_are_named_by_index() -> None:
    outputs = sample_outputs(1)
    plan = list(outputs.control.plan)
    plan[3] = (0.0, 0.5, 0.0, 0.0)
    changed = dataclasses.replace(outputs, control=dataclasses.replace(outputs.control, plan=tuple(plan)))
    found = first_difference(encode_outputs(outputs), encode_outputs(changed))
    assert found == "control.plan[3][0]: 0.6000000000000001 recorded, 0.0 replayed"


def test_other_kinds_of_difference() -> None:
    one, two = sample_outputs(1, sent=1), sample_outputs(1, sent=2)
    assert first_difference(encode_outputs(one), encode_outputs(two)) == "frames: 1 items recorded, 2 replayed"
    assert first_difference(encode_outputs(with_u(0.0)), encode_outputs(with_u(-0.0))) == (
        "estimate.u_mps: 0.0 recorded, -0.0 replayed"
    )
    gone = dataclasses.replace(one, pwm_us=None)
    assert first_difference(encode_outputs(one), encode_outputs(gone)) == (
        "pwm_us: [1620,1220] recorded, null replayed"
    )
    assert first_difference(encode_outputs(with_cost(math.nan)), encode_outputs(with_cost(1.0))) == (
        'control.cost: "NaN" recorded, 1.0 replayed'
    )
    assert first_difference(b'{"a":1}', b'{"b":1}') == "a: 1 recorded, absent in the replay"
    assert first_difference(b"{}", b'{"b":1}') == "b: absent in the record, 1 replayed"
    assert first_difference(b"x", b"{}") == "the recorded bytes are not JSON"
    assert first_difference(b"{}", b"x") == "the replayed bytes are not JSON"
    assert "same values" in str(first_difference(b'{"a":1}', b'{"a": 1}'))


def test_long_values_are_shortened() -> None:
    found = first_difference(b'{"a":"' + b"x" * 500 + b'"}', b'{"a":"y"}')
    assert found is not None and len(found) < 120 and "..." in found


def test_records_of_before_the_code_and_the_way_of_a_frame_are_read() -> None:
    outputs = sample_outputs(5)
    plain = json.loads(encode_outputs(outputs))
    del plain["health"]["code"]
    for frame in plain["frames"]:
        del frame["via"]
    assert decode_outputs(json.dumps(plain).encode()) == outputs


def test_a_record_with_a_text_that_is_no_utf8_is_refused() -> None:
    """msgspec raises UnicodeDecodeError for it, and not its own error."""
    data = encode_outputs(sample_outputs(1)).replace(b'"standby"', b'"st\x91ndby"').replace(b'"hold"', b'"h\x91ld"')
    with pytest.raises(LogError, match=r"^run\.mcap: outputs record: .*utf-8"):
        decode_outputs(data, Path("run.mcap"))
    assert first_difference(data, b"{}") == "the recorded bytes are not JSON"
    assert first_difference(b"{}", data) == "the replayed bytes are not JSON"
