"""What follows from a finding: the hold ends, or the operator is told, or nothing is watched."""

from __future__ import annotations

import pytest

from asvhil.config import load_config
from asvhil.motion.distance import DistanceWatch
from asvhil.motion.monitor import MotionMonitor
from asvhil.motion.watch import MotionWatch
from asvhil.supervisor.reasons import Explanation, Reason, describe, explain
from asvhil.types import Estimate, GroundVelocity, Heading, Position, Station, WaveMotion, Wind

STATION = Station(n_m=0.0, e_m=0.0, psi_rad=0.0)


class Drift:
    """A boat that is carried off from its station at 1 m/s."""

    def __init__(self, *overrides: str) -> None:
        self.watch = MotionWatch(load_config("sitl", overrides))
        self.t_ns = 0

    def run(
        self,
        seconds: float,
        station: Station | None = STATION,
        *,
        valid: bool = True,
        ailing: frozenset[type] = frozenset(),
    ) -> Explanation | None:
        found = None
        for _ in range(round(seconds * 20)):
            self.t_ns += 50_000_000
            estimate = Estimate(
                t_ns=self.t_ns, n_m=self.t_ns * 1e-9, e_m=0.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
                motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=valid,
            )  # fmt: skip
            found = self.watch.step(self.t_ns, (), (0.0, 0.0), None, estimate, ailing)
            self.watch.note_station(station)
        return found


def test_a_finding_ends_the_hold_and_is_noted_while_it_lasts() -> None:
    drift = Drift()
    assert drift.run(7.0) is None and drift.watch.notes == ()
    found = drift.run(3.0)
    assert found is not None and found.reason is Reason.DRIFTED_OFF
    assert [(note.subject, note.ok) for note in drift.watch.notes] == [("motion", False)]
    drift.run(0.1, None)
    assert drift.watch.notes == ()


def test_what_a_boat_has_drifted_without_its_receiver_is_not_held_against_the_motors() -> None:
    """It is told at once, with the first position after it; the boat is off by then, and is brought back."""
    drift = Drift()
    assert drift.run(4.0, ailing=frozenset({Position})) is None
    assert drift.run(10.0) is None, "8 m from where it was 3 s after the receiver came back"
    found = drift.run(1.5)
    assert found is not None and found.reason is Reason.DRIFTED_OFF, "who drifts on is let go"
    other = Drift()
    assert other.run(4.0, ailing=frozenset({Heading})) is None
    assert other.run(5.0) is not None, "another sensor's failure is none of the place"


def test_told_alone() -> None:
    drift = Drift("supervisor.motion.on_fault=tell")
    assert drift.run(12.0) is None
    assert "farther off the station" in drift.watch.notes[0].text


def test_off() -> None:
    drift = Drift("supervisor.motion.on_fault=off")
    assert drift.run(30.0) is None and drift.watch.notes == ()


def test_manoeuvres_may_go_where_they_like() -> None:
    drift = Drift("controller.name=manoeuvres")
    assert drift.run(100.0) is None and drift.watch.notes == ()


@pytest.mark.parametrize("station", [None, STATION])
def test_without_a_station_or_a_valid_estimate_no_distance_counts(station: Station | None) -> None:
    assert Drift().run(30.0, station, valid=station is None) is None


class SuspectedBoat:
    """A boat that stays, or is some metres off, and a monitor that suspects a motor while `suspects`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *overrides: str) -> None:
        self.watch = MotionWatch(load_config("sitl", overrides))
        self.t_ns, self.off_m, self.suspects = 0, 0.0, False
        self.waves: WaveMotion | None = None
        self.likely: Explanation | None = None
        fault = explain(Reason.MOTOR_DEAD, motor="port")
        monkeypatch.setattr(MotionMonitor, "step", lambda *_, **__: fault if self.suspects else None)
        monkeypatch.setattr(MotionMonitor, "likely", property(lambda _: self.likely))

    def run(self, seconds: float) -> Explanation | None:
        found = None
        for _ in range(round(seconds * 20)):
            self.t_ns += 50_000_000
            estimate = Estimate(
                t_ns=self.t_ns, n_m=self.off_m, e_m=0.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
                motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
            )  # fmt: skip
            found = found or self.watch.step(self.t_ns, (), (0.0, 0.0), None, estimate, frozenset(), self.waves)
            self.watch.note_station(STATION)
        return found


LIKELY = explain(Reason.NO_THRUST)


def test_what_is_likely_is_told_and_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.run(10.0)
    boat.likely = LIKELY
    assert boat.run(0.1) is None and boat.watch.notes[0].text == describe(LIKELY)
    boat.off_m = 7.5
    assert boat.run(5.0) is None
    boat.likely = None
    boat.run(19.9)
    assert len(boat.watch.notes) == 1
    boat.run(0.2)
    assert boat.watch.notes == ()


def test_what_is_likely_is_told_in_the_first_20_s_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    early, late = SuspectedBoat(monkeypatch), SuspectedBoat(monkeypatch)
    early.run(19.9)
    late.run(20.2)
    early.likely = late.likely = LIKELY
    for boat in (early, late):
        boat.run(0.1)
    assert early.watch.notes[0].text == describe(LIKELY) and late.watch.notes == ()


def test_what_is_sure_takes_the_place_of_what_is_likely(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch, "supervisor.motion.on_fault=tell")
    boat.likely = LIKELY
    boat.run(10.0)
    boat.suspects = True
    boat.run(0.1)
    assert "port motor gave no thrust" in boat.watch.notes[0].text
    boat.suspects = False
    boat.run(15.0)
    assert "port motor gave no thrust" in boat.watch.notes[0].text, "and keeps it"


def test_a_boat_that_leaves_with_something_likely_is_let_go_for_that(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.likely = LIKELY
    boat.run(5.0)
    boat.off_m = 8.1
    found = boat.run(0.1)
    assert found is not None and describe(found) == f"{describe(LIKELY)} (8 m farther off)"
    assert boat.watch.notes[0].text == describe(found)


def test_what_was_likely_and_is_taken_back_is_not_why_it_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.likely = LIKELY
    boat.run(5.0)
    boat.likely = None
    boat.run(20.2)
    boat.off_m = 8.1
    found = boat.run(0.1)
    assert found is not None and found.reason is Reason.DRIFTED_OFF


@pytest.mark.parametrize("rough", [False, True], ids=["late", "in waves"])
def test_late_or_in_waves_what_is_likely_is_not_told(rough: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    if rough:
        boat.waves = WaveMotion(peak_hz=0.3, velocity_std_mps=0.1, yaw_std_radps=0.04, share=1.0)
    else:
        boat.run(30.1)
    boat.likely = LIKELY
    assert boat.run(1.0) is None and boat.watch.notes == ()


def test_a_late_suspicion_is_told_and_taken_back_and_ends_nothing_after_that(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.run(40.0)
    boat.suspects = True
    assert boat.run(2.0) is None and "port motor gave no thrust" in boat.watch.notes[0].text
    boat.suspects = False
    assert boat.run(19.0) is None and len(boat.watch.notes) == 1
    assert boat.run(2.0) is None and boat.watch.notes == ()
    boat.off_m = 7.0
    assert boat.run(10.0) is None, "a swing long after it is no proof"


@pytest.mark.parametrize(
    ("share", "size_mps", "ends"),
    [(0.3, 0.15, True), (0.5, 0.15, False), (1.0, 0.15, False), (1.0, 0.04, False), (1.0, 0.02, True)],
    ids=["seen just now", "half of them", "all of them", "just rough", "the filter is always on, in calm water"],
)
def test_in_waves_an_early_suspicion_ends_a_hold_no_sooner_than_a_late_one(
    share: float, size_mps: float, ends: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.waves = WaveMotion(peak_hz=0.3, velocity_std_mps=size_mps, yaw_std_radps=0.04, share=share)
    boat.run(5.0)
    boat.suspects = True
    assert (boat.run(2.0) is not None) == ends
    boat.off_m = 6.5
    assert boat.run(1.0) is not None


@pytest.mark.parametrize(
    ("fault", "late"),
    [
        (explain(Reason.MOTORS_REVERSED), " (or one of them alone, or one is stuck)"),
        (explain(Reason.MOTOR_REVERSED, motor="port"), " (or the other one, or stuck)"),
        (explain(Reason.MOTOR_DEAD, motor="port"), ""),
    ],
)
def test_a_motor_that_turns_wrong_in_mid_hold_may_be_one_or_the_other(
    fault: Explanation, late: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for begins_s, hint in ((19.0, ""), (21.0, late)):
        boat = SuspectedBoat(monkeypatch)
        boat.run(begins_s)
        monkeypatch.setattr(MotionMonitor, "step", lambda *_, **__: fault)
        found = boat.run(0.1)
        assert found is not None and describe(found) == describe(fault) + hint


def test_a_late_suspicion_ends_the_hold_of_a_boat_that_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.run(40.0)
    boat.suspects, boat.off_m = True, 5.5
    assert boat.run(10.0) is None
    boat.off_m = 6.5
    found = boat.run(1.0)
    assert found is not None and found.reason is Reason.MOTOR_DEAD
    boat.suspects = False
    assert boat.run(30.0) is not None, "what has ended a hold stands"


def test_at_the_edges_of_time_and_distance(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hold begins with the second tick here: `since` is 50 ms less than what was run."""
    told = SuspectedBoat(monkeypatch, "supervisor.motion.sense_s=20")
    told.run(20.05)
    told.likely = LIKELY
    told.run(0.05)
    assert told.watch.notes, "just 20 s"
    ended = SuspectedBoat(monkeypatch, "supervisor.motion.sense_s=20")
    ended.run(20.05)
    ended.suspects = True
    assert ended.run(0.05) is not None, "just as long"
    away = SuspectedBoat(monkeypatch)
    away.run(40.0)
    away.suspects, away.off_m = True, 6.0
    assert away.run(0.05) is not None, "just as far"


def test_it_is_taken_back_after_more_than_20_s(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.run(40.0)
    boat.suspects = True
    boat.run(0.05)
    boat.suspects = False
    boat.run(20.0)
    assert boat.watch.notes
    boat.run(0.05)
    assert not boat.watch.notes


def test_the_monitor_has_the_limits_of_the_config() -> None:
    monitor = MotionWatch(load_config("sitl", ("supervisor.motion.evidence=9",)))._monitor
    assert monitor._verdict._config.evidence == 9.0


def test_a_boat_that_swings_about_the_limit_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch, "supervisor.motion.on_fault=tell")
    boat.run(40.0)
    told = []
    for boat.off_m in (8.1, 7.9, 8.2, 7.0, 8.1):
        boat.run(5.0)
        told.append(boat.watch.notes)
    assert len(told[0]) == 1 and len(set(told)) == 1
    boat.off_m = 1.0
    boat.run(21.0)
    assert boat.watch.notes == ()


def test_an_early_suspicion_ends_the_hold_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.run(10.0)
    boat.suspects = True
    assert boat.run(0.1) is not None


def test_the_next_hold_begins_anew() -> None:
    drift = Drift()
    assert drift.run(12.0) is not None
    drift.run(0.1, None)
    assert drift.run(7.0) is None


def test_the_monitor_gets_what_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, seen, begun = MotionWatch(load_config("sitl")), [], []
    monkeypatch.setattr(MotionMonitor, "step", lambda _, *what, **more: seen.append((*what, more)))
    monkeypatch.setattr(MotionMonitor, "on_measurement", lambda _, measurement: seen.append(measurement))
    monkeypatch.setattr(MotionMonitor, "begin", lambda _: begun.append(watch))
    heading, silent = Heading(t_ns=1, psi_rad=0.1), frozenset({GroundVelocity})
    wind = Wind(t_ns=0, vn_mps=3.0, ve_mps=-2.0, std_mps=0.5, valid=True)
    watch.step(1, (heading,), (0.1, 0.2), wind, None, silent)
    watch.note_station(STATION)
    watch.note_station(STATION)
    watch.step(2, (), (0.3, 0.4), None, None, frozenset())
    watch.note_station(None)
    watch.note_station(STATION)
    assert seen == [
        heading,
        (1, (0.1, 0.2), (3.0, -2.0), silent, {"holding": False, "late": False}),
        (2, (0.3, 0.4), None, frozenset(), {"holding": True, "late": False}),
    ]
    assert len(begun) == 2, "each hold begins anew, and no tick of it"


def test_a_hold_is_late_for_the_monitor_after_30_s_and_in_waves(monkeypatch: pytest.MonkeyPatch) -> None:
    boat, late = SuspectedBoat(monkeypatch), []
    monkeypatch.setattr(MotionMonitor, "step", lambda *_, **given: late.append(given["late"]))
    boat.run(30.0)
    assert not any(late)
    boat.run(0.2)
    assert late[-1]
    boat.watch.note_station(None)
    boat.run(0.1)
    boat.run(0.1)
    assert not late[-1]
    boat.waves = WaveMotion(peak_hz=0.3, velocity_std_mps=0.1, yaw_std_radps=0.04, share=1.0)
    boat.run(0.05)
    assert late[-1]


def test_what_is_found_while_no_hypothesis_predicts_well_is_late(monkeypatch: pytest.MonkeyPatch) -> None:
    boat, late = SuspectedBoat(monkeypatch), []
    monkeypatch.setattr(MotionMonitor, "doubtful", True)
    boat.run(2.0)
    boat.suspects = True
    assert boat.run(2.0) is None and boat.watch.notes, "told, and no end"
    monkeypatch.setattr(MotionMonitor, "step", lambda *_, **given: late.append(given["late"]))
    boat.run(0.1)
    monkeypatch.setattr(MotionMonitor, "doubtful", False)
    boat.run(0.1)
    assert late == [True, True, False, False]


def test_the_distance_gets_the_command_and_the_current(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, seen = MotionWatch(load_config("sitl")), []
    monkeypatch.setattr(DistanceWatch, "step", lambda _, *what: seen.append(what))
    monkeypatch.setattr(MotionMonitor, "current_ned", (0.4, -0.3))
    estimate = Estimate(
        t_ns=5, n_m=1.0, e_m=2.0, psi_rad=0.0, u_mps=0.0, v_mps=0.0, r_radps=0.0,
        motor=(), std=(), disturbance=(0.0, 0.0, 0.0), valid=True,
    )  # fmt: skip
    watch.note_station(STATION)
    watch.step(5, (), (0.3, 0.4), None, estimate, frozenset())
    assert seen == [(5, estimate, STATION, (0.3, 0.4), (0.4, -0.3), 0.0, None)]


@pytest.mark.parametrize("enabled", [False, True])
def test_the_procedure_has_room_where_it_is_enabled(enabled: bool) -> None:
    procedure = MotionWatch(load_config("sitl", (f"controller.procedure.enabled={str(enabled).lower()}",)))._distance
    assert (procedure._approach is not None) is enabled


def test_an_early_suspicion_is_early_from_the_begin_of_its_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.run(40.0)
    boat.watch.note_station(None)
    boat.run(29.9)
    boat.suspects = True
    assert boat.run(0.05) is not None


def test_just_after_it_a_suspicion_is_late(monkeypatch: pytest.MonkeyPatch) -> None:
    boat = SuspectedBoat(monkeypatch)
    boat.run(30.2)
    boat.suspects = True
    assert boat.run(0.5) is None
