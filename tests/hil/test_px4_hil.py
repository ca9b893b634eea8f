"""PX4's simulator interface, sans-IO: when a sample goes out, what it says, and what drives the motors."""

from __future__ import annotations

import pytest

from asvhil.io.mavlink.frames import dialect as mav
from asvhil.simplant.hil.px4 import NEVER_NS
from tests.support.px4_sitl import CALM, FAST, FREE, MS, SECOND, Sitl, of, samples_us


def test_nothing_but_heartbeats_until_the_autopilot_has_spoken() -> None:
    sitl = Sitl(boot=False)
    sent = sitl.wait(3 * SECOND)
    assert [message.get_type() for message in sent] == ["HEARTBEAT"] * 4
    assert (sent[0].type, sent[0].autopilot) == (mav.MAV_TYPE_GENERIC, mav.MAV_AUTOPILOT_INVALID)
    sitl.send_bytes(b"\0garbage\xfd\xfe")
    assert samples_us(sitl.wait(SECOND)) == []


def test_real_time_until_the_first_answer() -> None:
    sitl = Sitl()
    assert samples_us(sitl.wait(100 * MS)) == [4000 * k for k in range(1, 27)]
    assert not sitl.hil.lockstep


def test_in_lockstep_each_sample_waits_for_its_answer() -> None:
    sitl = Sitl(FAST)
    (first,) = of(sitl.poll(), "HIL_SENSOR")
    sitl.answer(first.time_usec)
    sitl.t_ns += 4 * MS
    for count in range(2, 100):
        (sample,) = of(sitl.poll(), "HIL_SENSOR")
        assert sample.time_usec == 4000 * count
        assert samples_us(sitl.poll()) == []  # no time has passed and no answer has come
        sitl.answer(sample.time_usec)
    assert (sitl.hil.counters.samples, sitl.hil.counters.unanswered) == (99, 0)


def test_an_answer_that_comes_twice_is_no_answer_to_the_next_sample() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(10)
    (sample,) = of(sitl.poll(), "HIL_SENSOR")
    for _ in range(5):
        sitl.answer(sample.time_usec - 4000)
        assert samples_us(sitl.poll()) == []
    assert sitl.hil.counters.duplicates == 5
    sitl.answer(sample.time_usec)
    assert samples_us(sitl.poll()) == [sample.time_usec + 4000]


def test_a_sample_without_answer_holds_nothing_up() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(10)
    assert len(samples_us(sitl.wait(0))) == 1
    assert samples_us(sitl.wait(9 * MS)) == []
    assert len(samples_us(sitl.wait(1 * MS))) == 1  # answer_timeout_s is 0.01
    assert sitl.hil.counters.unanswered == 1


def test_a_late_answer_is_to_its_own_sample() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(10)
    late, current = samples_us(sitl.wait(10 * MS))
    sitl.answer(late)
    assert samples_us(sitl.wait(9 * MS)) == []
    sitl.answer(current)
    assert samples_us(sitl.poll()) == [current + 4000]


def test_a_rover_that_answers_each_third_sample_is_waited_for_at_the_third() -> None:
    sitl = Sitl(FAST)
    sitl.lockstep(5)
    for _ in range(3):
        last_us = sitl.next()[-1].time_usec
    assert sitl.hil.counters.unanswered == 2
    sitl.answer(last_us)
    for k in range(30):
        sent = samples_us(sitl.wait(0))
        assert sent == [last_us + 12_000 * k + 4000 * n for n in (1, 2, 3)]
        assert samples_us(sitl.wait(MS)) == []
        sitl.answer(sent[-1])
    assert sitl.hil.counters.unanswered == 2


def test_a_loop_that_does_not_divide_the_sensor_rate_costs_no_time() -> None:
    """A rover's 100 Hz against 250 samples a second: PX4 answers after 2 and 3 samples by turns."""
    sitl = Sitl(FAST)
    sitl.lockstep(1)
    start_us, start_ns = sitl.hil.plant.t_ns // 1000, sitl.t_ns
    loop_us, in_vain = 0, []
    while sitl.hil.plant.t_ns // 1000 < start_us + 2_000_000:
        sitl.t_ns = max(sitl.t_ns, sitl.hil.next_ns)
        for sample_us in samples_us(sitl.poll()):
            if sample_us >= loop_us + 10_000:
                loop_us = sample_us // 10_000 * 10_000
                sitl.answer(sample_us)
                in_vain.append(sitl.hil.counters.unanswered)
    assert in_vain[10] == in_vain[-1] <= 3
    assert sitl.t_ns - start_ns <= 3 * 10 * MS  # no wait but for those


def test_a_px4_that_falls_silent_drives_no_motor_and_holds_nothing_up() -> None:
    sitl = Sitl(FREE, FAST, CALM)
    sitl.lockstep(500, 0.5, 0.5)
    answered_ns, start_ns = sitl.hil.plant.t_ns, sitl.t_ns
    while sitl.hil.plant.t_ns < answered_ns + 200 * MS:
        assert sitl.hil.lockstep and sitl.hil.plant.truth.outputs_us == (1700, 1700)
        sitl.next()
    sitl.next()
    assert (sitl.hil.lockstep, sitl.hil.armed, sitl.hil.silent) == (False, False, True)
    assert sitl.hil.plant.truth.outputs_us == (0, 0)
    assert sitl.t_ns - start_ns <= 51 * 10 * MS  # each of 50 samples was waited for
    before_ns = sitl.hil.plant.t_ns
    assert len(samples_us(sitl.wait(SECOND))) == pytest.approx(250, abs=3)  # in real time from there
    assert sitl.hil.plant.t_ns - before_ns == pytest.approx(SECOND, abs=12 * MS)
    waited = sitl.hil.counters.unanswered
    sitl.lockstep(100, 0.25, 0.25)
    assert sitl.hil.lockstep and sitl.hil.outputs_us == (1600, 1600) and not sitl.hil.silent
    assert (sitl.hil.counters.silences, sitl.hil.counters.unanswered) == (1, waited)


def test_a_board_that_falls_silent_drives_no_motor() -> None:
    sitl = Sitl(FREE)
    sitl.flags = 0
    sitl.answer(1, 0.5, 0.5)
    sitl.wait(190 * MS)
    assert sitl.hil.plant.truth.outputs_us == (1700, 1700)
    sitl.wait(30 * MS)
    assert sitl.hil.plant.truth.outputs_us == (0, 0)


def test_the_pace_is_real_time_and_a_stall_is_not_made_up_for() -> None:
    sitl = Sitl()
    sitl.lockstep(5)
    sitl.answer(sitl.next()[-1].time_usec)
    assert samples_us(sitl.wait(3 * MS)) == []  # answered at once, but the next is due 4 ms after it
    assert len(samples_us(sitl.wait(1 * MS))) == 1
    sitl.t_ns += 10 * SECOND
    for _ in range(3):
        sitl.answer(sitl.hil.plant.t_ns // 1000)
        (sample_us,) = samples_us(sitl.poll())
        sitl.answer(sample_us)
        assert samples_us(sitl.wait(3 * MS)) == []
        assert len(samples_us(sitl.wait(1 * MS))) == 1
        sitl.wait(4 * MS)


def test_twice_real_time() -> None:
    sitl = Sitl("plant.hil.px4.speed=2")
    sitl.lockstep(1)
    start_us, start_ns = sitl.hil.plant.t_ns // 1000, sitl.t_ns
    for _ in range(100):
        sample = sitl.next()[-1]
        sitl.answer(sample.time_usec)
    assert sample.time_usec - start_us == 2 * (sitl.t_ns - start_ns) // 1000


def test_a_board_without_lockstep_is_fed_in_real_time() -> None:
    sitl = Sitl(FAST)
    sitl.flags = 0
    sitl.answer(1)
    assert len(samples_us(sitl.wait(SECOND))) == 251
    assert sitl.hil.counters.unanswered == 0


def test_a_client_that_comes_back_finds_the_boat_at_its_start() -> None:
    sitl = Sitl(FREE)
    sitl.lockstep(500, 0.6, 0.6)
    moved = sitl.hil.plant.truth
    sitl.hil.disconnect()
    assert sitl.hil.next_ns == NEVER_NS and sitl.poll() == []
    sitl.hil.connect(sitl.t_ns)
    assert sitl.hil.counters.restarts == 1 and not sitl.hil.armed
    truth = sitl.hil.plant.truth
    assert (truth.t_ns, truth.n_m, truth.e_m) == (0, -14.0, -3.0) and moved.n_m > -13.9
    sitl.send(mav.MAVLink_heartbeat_message(0, mav.MAV_AUTOPILOT_PX4, 0, 0, 0, 3))
    assert samples_us(sitl.lockstep(3)) == [4000, 8000, 12000]


def test_a_clock_that_runs_back_is_a_restart() -> None:
    sitl = Sitl(FREE)
    sitl.lockstep(500, 0.6, 0.6)
    sitl.answer(10)
    assert (sitl.hil.counters.restarts, sitl.hil.plant.t_ns) == (1, 0)
