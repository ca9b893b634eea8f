"""Faults put into recorded logs: the backseat notices and does what it does where the boat itself has the fault."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from asvhil.commands.cli import app
from asvhil.config import load_config
from asvhil.config.fault_text import parse_fault, with_faults
from asvhil.errors import ConfigError
from asvhil.logs.encoding import decode_outputs
from asvhil.logs.fault_replay import Noticed, RecordedPulses, replay_with_faults
from asvhil.logs.info import log_info
from asvhil.logs.reader import LogFile
from asvhil.sitl import run_lockstep
from asvhil.types import Phase
from tests.support.shifted_logs import shifted

Logs = Callable[..., Path]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Logs:
    """Logs in lockstep by config, faults and length, each made once.

    Of the paper's controller: in the open loop of an edited log an estimate without a receiver goes where its model has
    it go, and whether it leaves the station by the limit in these few seconds depends on the model.
    """

    @cache
    def log(config: str, *faults: str, seconds: float = 32.0) -> Path:
        path = tmp_path_factory.mktemp("faults") / "log.mcap"
        run_lockstep(with_faults(load_config(config, ("controller.name=nnsem-mpc",)), list(faults)), path, seconds)
        return path

    return log


def reaction(path: Path, *faults: str) -> Noticed:
    return replay_with_faults(path, [parse_fault(text) for text in faults])


def first_told(path: Path, sound: Path) -> dict[tuple[str, str], float]:
    """When a log has each bad note first that the sound one never has."""
    never = {key for key, _ in bad_notes(sound)}
    found: dict[tuple[str, str], float] = {}
    for key, t_s in bad_notes(path):
        if key not in never:
            found.setdefault(key, t_s)
    return found


@cache
def bad_notes(path: Path) -> list[tuple[tuple[str, str], float]]:
    ticks = [decode_outputs(data) for _, data in LogFile(path).ticks() if data is not None]
    return [
        ((note.subject, note.text), (outputs.t_ns - ticks[0].t_ns) * 1e-9)
        for outputs in ticks
        for note in outputs.health.notes
        if not note.ok
    ]


def hold_end(path: Path) -> tuple[float, str] | None:
    """When and for which reason the hold of a log ended, None where the operator released it."""
    ticks = [decode_outputs(data) for _, data in LogFile(path).ticks() if data is not None]
    was = Phase.STANDBY
    for outputs in ticks:
        if was == Phase.HOLD != outputs.phase and outputs.health.code != "released":
            return (outputs.t_ns - ticks[0].t_ns) * 1e-9, outputs.health.reason
        was = outputs.phase
    return None


def further(config: str, *faults: str) -> list[Any]:
    """Cases that `make test` leaves out: another of each kind of reaction is among the first."""
    return [pytest.param(config, fault, marks=pytest.mark.thorough) for fault in faults]


def test_a_fault_after_the_last_fix_changes_no_byte(logs: Logs) -> None:
    found = reaction(logs("sitl"), "gnss-jump@32.09:5s")
    assert found.ticks == 643 and found.edited == 0 and found.first_difference is None
    assert found.holds == found.recorded_holds and len(found.holds) == 1
    assert found.notes == () and found.pulses_apart_us == 0 and found.judged_to_s is None


@pytest.mark.parametrize(
    ("config", "fault"),
    [
        ("sitl", "gnss-jump@14"),
        ("sitl", "anemometer-stuck@14:8s"),
        ("sitl", "imu-silent@14"),
        ("sitl", "compass-turned@0"),
        ("sitl-bream", "gnss-silent@14"),
        ("sitl-bream", "heading-jump@14:5s:90deg"),
        *further("sitl", "gnss-silent@14", "gnss-frozen@14", "gnss@14"),
        *further("sitl", "anemometer@14:8s", "heading-jump@14:8s", "heading-jump@14:15s:-60deg"),
        *further("sitl-bream", "gnss-frozen@14", "heading-silent@14", "nmea@14", "gnss-jump@14:5s:40m"),
    ],
)
def test_it_notices_what_it_notices_on_a_boat_with_the_fault(logs: Logs, config: str, fault: str) -> None:
    sound, faulty = logs(config), logs(config, fault)
    found = reaction(sound, fault)
    # Later notes are those of a boat that has gone elsewhere since.
    until_s = parse_fault(fault).from_s + 6.0
    expected = {key: t_s for key, t_s in first_told(faulty, sound).items() if t_s < until_s}
    told = {(subject, text): t_s for t_s, subject, text, ok in found.notes if not ok}
    assert {key: pytest.approx(t_s, abs=0.5) for key, t_s in expected.items()} == {
        key: told[key] for key in expected if key in told
    }
    assert found.first_difference is not None or not expected
    ended = hold_end(faulty)
    if ended is None:
        assert found.holds == found.recorded_holds
    else:
        t_s, reason = ended
        assert found.holds[0]["to_s"] == pytest.approx(t_s, abs=2.0) and reason in found.holds[0]["ended"]
        assert found.recorded_holds[0]["to_s"] > 29.0


@pytest.mark.thorough
def test_neither_the_pilot_nor_the_outputs_are_blamed_for_what_was_edited(logs: Logs) -> None:
    """Neutral in a fail-safe, and a hold that goes on afterwards, though the record's motors ran all the time."""
    found = reaction(logs("sitl", seconds=60.0), "gnss-silent@10:28s")
    assert found.holds[0]["ended"] == "failsafe: position or heading is stale"
    assert len(found.holds) == 2 and found.holds[1]["from_s"] > 38.0 and "released by" in found.holds[1]["ended"]
    told = {subject for _, subject, _, ok in found.notes if not ok}
    assert told - {"model"} == {"gnss position", "gnss velocity"}  # the estimate of these seconds may not fit the model
    assert found.pulses_apart_us > 100


def test_what_no_edit_can_reach_is_named(logs: Logs) -> None:
    assert reaction(logs("sitl-vn300"), "gnss-jump@14").untouched == ("ins",)
    silent = reaction(logs("sitl-vn300"), "ins@14")
    assert silent.untouched == () and silent.edited > 300


def test_pulses_of_the_record_stand_where_it_drove() -> None:
    pulses = RecordedPulses(load_config("sitl").vehicle.pwm)
    pulses.begin_tick((1600, 1700))
    assert pulses.step(0, (0.0, 0.0)) == (1600, 1700) and pulses.wanted_us == (1500, 1500) and not pulses.alone
    assert pulses.neutral() == (1600, 1700) and not pulses.alone
    pulses.begin_tick(None)
    assert pulses.wanted_us is None
    assert pulses.neutral() == (1500, 1500) and not pulses.alone
    assert pulses.step(1, (0.0, 0.0)) == (1500, 1500) and pulses.alone


@pytest.mark.parametrize("kind", ["port-motor", "motors-swapped", "transmitter"])
def test_what_would_have_moved_the_boat_otherwise_is_refused(logs: Logs, kind: str) -> None:
    with pytest.raises(ConfigError, match=f"--fault {kind}: cannot be put into a log.*gnss-jump"):
        reaction(logs("sitl"), f"{kind}@5")


def test_the_command_tells_and_writes_it(logs: Logs, tmp_path: Path) -> None:
    out = tmp_path / "reaction.json"
    result = CliRunner().invoke(
        app,
        [
            "replay",
            str(logs("sitl", seconds=45.0)),
            "--fault",
            "gnss-silent@8",
            "--fault",
            "anemometer@22:5s",
            "--json",
            str(out),
        ],
    )
    assert result.exit_code == 0, result.output
    figures = json.loads(out.read_text())
    assert figures["faults"] == ["gnss-silent@8", "anemometer@22:5s"] and figures["edited_frames"] > 100
    assert figures["first_difference"]["t_s"] == pytest.approx(8.1, abs=0.2)
    assert figures["holds"][0]["ended"] == "failsafe: position or heading is stale (gnss position frozen)"
    assert {note["subject"] for note in figures["notes"]} >= {"gnss position", "anemometer"}
    text = " ".join(result.output.split())
    assert "with the faults: hold from" in text and "position or heading is stale" in text


def test_a_telemetry_log_takes_no_faults() -> None:
    result = CliRunner().invoke(app, ["replay", "--tlog", "x.tlog", "--fault", "gnss@5"])
    assert result.exit_code != 0 and "--fault goes with an MCAP log" in str(result.exception or result.output)


def test_a_fault_behind_the_end_of_the_log_is_refused_at_once(logs: Logs) -> None:
    path = logs("sitl")
    with pytest.raises(
        ConfigError, match=r"--fault gnss-jump@600: begins behind the end of .*log\.mcap; a time of 0 to"
    ):
        replay_with_faults(path, [parse_fault("gnss-jump@600:5s:20m")], lambda ticks: pytest.fail("replayed"))


@pytest.mark.parametrize("by_s", [3.0, -3600.0])
def test_times_of_a_fault_are_those_of_the_report(logs: Logs, tmp_path: Path, by_s: float) -> None:
    """A stall is time, a clock that goes back is none."""
    path = shifted(logs("sitl"), tmp_path / "shifted.mcap", by_s, 300)
    holds = log_info(path)["holds"]
    noticed = reaction(path, "anemometer@26:4s")
    assert noticed.edited and noticed.span_s == pytest.approx(log_info(path)["duration_s"], abs=1e-3)
    assert [hold["to_s"] for hold in noticed.recorded_holds] == pytest.approx([hold["to_s"] for hold in holds])
    assert min(t_s for t_s, subject, _, ok in noticed.notes if subject == "anemometer" and t_s > 20.0) == pytest.approx(
        28.0, abs=2.0
    )
    with pytest.raises(ConfigError, match=f"a time of 0 to {noticed.span_s:.1f} s is expected"):
        reaction(path, "anemometer@600")
