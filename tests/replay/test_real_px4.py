"""Recordings of real PX4s, in software in the loop: decoded by the profile, and estimated from."""

from pathlib import Path

import pytest

from asvhil.autopilot.px4 import Px4Autopilot
from asvhil.config import load_config
from asvhil.logs.tlog import read_tlog
from asvhil.logs.tlog_check import check_tlog
from asvhil.types import Frame, FrontseatStatus, Heading, Position, Radio
from tests.support.paths import DATA

REST = DATA / "px4-1.16-rest-and-hold.tlog"  # disarmed at rest, OFFBOARD, armed, holding, released, holding, Hold
GNSS_LOST = DATA / "px4-1.16-gnss-lost.tlog"  # armed in OFFBOARD; GNSS switched off in PX4
JOYSTICK_LOST = DATA / "px4-1.15-joystick-lost.tlog"  # armed; the joystick falls silent: Hold for 5 s, then Return


def told(path: Path) -> tuple[list[tuple[float, FrontseatStatus]], list[tuple[float, object]], Px4Autopilot]:
    """(time in s, status) and (time, measurement) of a recording, through the profile."""
    config = load_config("field-px4")
    link = Px4Autopilot(config.links.autopilot, config.vehicle.pwm)
    statuses, measurements, first_us = [], [], None
    for unix_us, data in read_tlog(path):
        first_us = unix_us if first_us is None else first_us
        for _, measurement in link.receive(Frame(t_ns=unix_us * 1000, port="autopilot", data=data, peer="x")):
            t_s = (unix_us - first_us) * 1e-6
            if isinstance(measurement, FrontseatStatus):
                statuses.append((t_s, measurement))
            else:
                measurements.append((t_s, measurement))
    return statuses, measurements, link


@pytest.mark.parametrize("path", [REST, GNSS_LOST, JOYSTICK_LOST], ids=lambda path: path.stem)
def test_nothing_is_garbage_and_what_the_dialect_does_not_know_is_counted(path: Path) -> None:
    counters = dict(told(path)[2].counters())
    assert (counters["autopilot.garbage_bytes"], counters["autopilot.bad_crc"]) == (0, 0)
    assert counters["autopilot.unknown"] > 100


def test_a_px4_at_rest_is_ready() -> None:
    statuses, measurements, _ = told(REST)
    disarmed = [status for _, status in statuses if not status.armed and status.mode == "AUTO.LOITER"]
    assert disarmed and disarmed[-1].ready
    first_s = {kind: next(t for t, m in measurements if isinstance(m, kind)) for kind in (Position, Heading)}
    armed_s = next(t for t, status in statuses if status.armed)
    assert max(first_s.values()) < 1.0 < armed_s
    modes = [status.mode for t, status in statuses if status.armed]
    assert set(modes) == {"OFFBOARD"}
    assert all(status.ready for t, status in statuses if t > 1.0)


def test_its_estimate_is_followed_from_rest_on() -> None:
    figures = check_tlog(load_config("field-px4"), REST)
    assert figures["estimate_s"] > 12.0
    assert figures["against_autopilot"]["position_m"]["max"] < 0.5
    assert figures["against_autopilot"]["heading_deg"]["max"] < 2.0


def test_a_px4_that_drops_gnss_is_not_ready() -> None:
    statuses, measurements, _ = told(GNSS_LOST)
    ready = [status.ready for _, status in statuses]
    lost = next(t for t, status in statuses if t > 2.0 and not status.ready)
    assert 8.0 < lost < 10.0 and not ready[-1]
    assert max(t for t, m in measurements if isinstance(m, Position)) <= lost
    assert max(t for t, m in measurements if isinstance(m, Heading)) > lost + 1.0, "it stays aligned"


def test_a_joystick_that_falls_silent_ends_in_return_after_five_seconds_of_hold() -> None:
    statuses, _, link = told(JOYSTICK_LOST)
    since: dict[str, float] = {}
    for t_s, status in statuses:
        if status.mode:
            since.setdefault(status.mode, t_s)
    assert list(since) == ["OFFBOARD", "AUTO.LOITER", "AUTO.RTL"]
    assert since["AUTO.RTL"] - since["AUTO.LOITER"] == pytest.approx(5.0, abs=0.3)
    assert link.transmitter.radio is not Radio.HEARD
