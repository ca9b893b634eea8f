"""Inputs, Outputs and logs that the tests of recorder, log file, encoding and views share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from asvhil.geo import LocalFrame
from asvhil.logs.recorder import Recorder
from asvhil.types import Control, Estimate, Frame, Health, Inputs, Outputs, Phase, Station, Wind

METADATA = {
    "config": {"json": '{"vehicle": {"name": "wamv16"}}', "hash": "0123456789abcdef"},
    "versions": {"python": "3.11", "asvhil": "0.1.0"},
    "run": {"seed": "7", "mode": "live"},
}
START_NS = 1_790_000_000_123_456_789
TICK_NS = 50_000_000
ORIGIN = LocalFrame(lat_deg=40.0, lon_deg=-86.0)


def sample_inputs(tick: int, frames: int = 3) -> Inputs:
    """Frames of two ports and two peers, with bytes that are neither text nor MAVLink."""
    t_ns = START_NS + tick * TICK_NS
    received = tuple(
        Frame(
            t_ns=t_ns - 1000 * (frames - i),
            port="anemometer" if i % 3 == 2 else "autopilot",
            data=bytes([0xFD, i, tick % 256, 0x00, 0xFF]) * 4,
            peer="" if i % 3 == 2 else f"127.0.0.1:{14550 + i % 2}",
        )
        for i in range(frames)
    )
    return Inputs(t_ns=t_ns, frames=received)


def sample_outputs(tick: int, control: bool = True, sent: int = 1) -> Outputs:
    """Outputs with every field set, or without a control; floats that have no short decimal."""
    t_ns = START_NS + tick * TICK_NS
    plan = tuple((0.2 * i, 0.1 * i / 3.0, -1.0 / (i + 7.0), 0.01 * i) for i in range(21))
    return Outputs(
        t_ns=t_ns,
        phase=Phase.HOLD if control else Phase.STANDBY,
        frames=tuple(Frame(t_ns=t_ns, port="autopilot", data=bytes(range(30)), peer="") for _ in range(sent)),
        estimate=Estimate(
            t_ns=t_ns,
            n_m=1.0 / 3.0,
            e_m=-2.0e-17,
            psi_rad=3.0,
            u_mps=0.12,
            v_mps=-0.0,
            r_radps=1e22,
            motor=(0.1, 0.2),
            std=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
            disturbance=(0.01, -0.02, 0.003),
            valid=True,
        ),
        wind=Wind(t_ns=t_ns, vn_mps=2.5, ve_mps=-1.5, std_mps=0.3, valid=True) if control else None,
        station=Station(n_m=0.0, e_m=0.0, psi_rad=0.5) if control else None,
        control=Control(command=(0.3, -0.7), ok=True, iterations=3, cost=12.5, plan=plan) if control else None,
        pwm_us=(1620, 1220) if control else None,
        health=Health(
            reason="",
            link_ok=True,
            estimate_ok=True,
            wind_ok=True,
            control_ok=True,
            model_ok=True,
            counters=(("autopilot_bad", 0), ("autopilot_lost", 2)),
        ),
        origin_deg=(ORIGIN.lat_deg, ORIGIN.lon_deg),
    )


def make_recorder(path: Path, threaded: bool = False, chunk_kib: int = 16, **options: int) -> Recorder:
    """A recorder with small chunks and a short sync period."""
    return Recorder(path, metadata=METADATA, chunk_kib=chunk_kib, sync_period_s=0.1, threaded=threaded, **options)


def record_ticks(recorder: Recorder, ticks: range) -> None:
    for tick in ticks:
        recorder.write_inputs(sample_inputs(tick, frames=tick % 4))
        recorder.write_outputs(sample_outputs(tick, control=tick % 4 == 0))
        recorder.write_timing(START_NS + tick * TICK_NS, 1000 + tick, tick == 3)


def assert_fits(value: Any, schema: dict[str, Any], where: str = "message") -> None:
    """The value obeys the JSON Schema: all the keywords that SCHEMAS uses, and no keys besides its own."""
    assert set(schema) <= {
        "title", "type", "properties", "required", "items", "minItems", "maxItems", "enum", "minimum", "maximum",
    }, where  # fmt: skip
    kinds = {"object": dict, "array": list, "number": (int, float), "integer": int, "string": str, "boolean": bool}
    assert isinstance(value, kinds[schema["type"]]), where
    assert schema["type"] == "boolean" or not isinstance(value, bool), where
    if "enum" in schema:
        assert value in schema["enum"], where
    if "minimum" in schema:
        assert value >= schema["minimum"], where
    if "maximum" in schema:
        assert value <= schema["maximum"], where
    if isinstance(value, dict):
        assert set(schema.get("required", [])) <= set(value) <= set(schema["properties"]), where
        for key, part in value.items():
            assert_fits(part, schema["properties"][key], f"{where}.{key}")
    if isinstance(value, list):
        assert schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", 10**9), where
        for i, part in enumerate(value):
            assert_fits(part, schema["items"], f"{where}[{i}]")
