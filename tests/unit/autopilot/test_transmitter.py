"""State of the pilot's transmitter, and the reasons of an autopilot for not arming."""

from typing import Any

import pytest

from asvhil.autopilot.arming_checks import CHECKS, ArmingChecks
from asvhil.autopilot.transmitter import RECEIVER, Transmitter
from asvhil.io.mavlink.frames import dialect
from asvhil.io.mavlink.texts import Texts
from asvhil.types import Radio

MS = 1_000_000
S = 1000 * MS


class Radios:
    """An autopilot that reports its radio at 10 Hz (RC_CHANNELS) and 2 Hz (SYS_STATUS)."""

    def __init__(self) -> None:
        self.transmitter = Transmitter()
        self.t_ns = 0

    def run(
        self, seconds: float, *, channels: int | None, rssi: int = 255, bit: bool | None = None, driven: bool = False
    ) -> Radio:
        """`bit`: the health of the receiver, None where it is not there at all; `driven`: overrides flow."""
        for tick in range(round(seconds * 10)):
            self.t_ns += 100 * MS
            if driven:
                self.transmitter.note_override(self.t_ns)
            if channels is not None:
                self.transmitter.on_rc_channels(self.t_ns, channels, rssi)
            if tick % 5 == 0:
                present = 0 if bit is None else RECEIVER
                self.transmitter.on_sys_status(self.t_ns, present, RECEIVER if bit else 0)
        return self.transmitter.radio


def test_a_boat_without_a_receiver_has_none_while_overrides_count_as_radio_too() -> None:
    radios = Radios()
    assert radios.transmitter.radio is Radio.UNKNOWN
    assert radios.run(3.0, channels=0) is Radio.ABSENT
    assert radios.run(3.0, channels=0, bit=True, driven=True) is Radio.ABSENT  # as measured: the bit comes with us
    assert radios.run(3.0, channels=0, bit=False) is Radio.ABSENT


def test_a_lost_transmitter_keeps_its_channels_and_loses_its_health() -> None:
    radios = Radios()
    assert radios.run(3.0, channels=8, bit=True) is Radio.HEARD
    assert radios.run(3.0, channels=8, bit=False) is Radio.LOST
    assert radios.run(0.5, channels=8, bit=True) is Radio.HEARD


def test_overrides_hide_a_loss_and_do_not_make_one_good_again() -> None:
    radios = Radios()
    radios.run(3.0, channels=8, bit=True)
    assert radios.run(5.0, channels=8, bit=True, driven=True) is Radio.HEARD  # nothing tells
    radios.run(3.0, channels=8, bit=False)
    assert radios.run(5.0, channels=8, bit=True, driven=True) is Radio.LOST
    assert radios.run(0.9, channels=8, bit=True) is Radio.LOST  # the last override still counts
    assert radios.run(1.0, channels=8, bit=True) is Radio.HEARD


@pytest.mark.parametrize("driven", [True, False])
def test_a_signal_strength_of_0_tells_of_a_loss_where_there_was_one(driven: bool) -> None:
    radios = Radios()
    assert radios.run(3.0, channels=8, rssi=0, bit=True, driven=driven) is Radio.HEARD  # not reported
    assert radios.run(3.0, channels=8, rssi=180, bit=True, driven=driven) is Radio.HEARD
    assert radios.run(0.9, channels=8, rssi=0, bit=True, driven=driven) is Radio.HEARD  # a moment is no loss
    assert radios.run(0.3, channels=8, rssi=0, bit=True, driven=driven) is Radio.LOST
    assert radios.run(1.2, channels=8, rssi=90, bit=True) is Radio.HEARD


def test_a_px4_without_rc_channels_is_judged_by_its_bits() -> None:
    radios = Radios()
    assert radios.run(2.0, channels=None) is Radio.ABSENT
    assert radios.run(2.0, channels=None, bit=False) is Radio.ABSENT
    assert radios.run(2.0, channels=None, bit=True) is Radio.HEARD
    assert radios.run(2.0, channels=None, bit=False) is Radio.LOST


def test_the_receivers_bits_are_its_own_and_count_only_where_it_is_there() -> None:
    others = 0xFFFFFFFF & ~RECEIVER
    for present, health, radio in (
        (others, 0xFFFFFFFF, Radio.ABSENT),
        (others, others, Radio.ABSENT),
        (0xFFFFFFFF, others, Radio.ABSENT),  # it has never been heard
        (RECEIVER, RECEIVER, Radio.HEARD),
    ):
        transmitter = Transmitter()
        transmitter.on_sys_status(S, present, health)
        assert transmitter.radio is radio


def test_channels_without_bits_are_heard_and_with_a_bit_that_is_gone_are_lost() -> None:
    transmitter = Transmitter()
    transmitter.on_rc_channels(S, 8, 255)
    assert transmitter.radio is Radio.HEARD and transmitter.tells_signal is False
    transmitter.on_sys_status(S, 0, 0)
    assert transmitter.radio is Radio.LOST
    transmitter.restart()
    assert transmitter.radio is Radio.UNKNOWN


def test_the_least_signal_is_one_and_a_second_without_is_a_loss() -> None:
    transmitter = Transmitter()
    transmitter.on_rc_channels(S, 8, 1)
    assert transmitter.tells_signal
    transmitter.on_rc_channels(2 * S, 8, 0)
    transmitter.on_rc_channels(3 * S - 1, 8, 0)
    assert transmitter.radio is Radio.HEARD
    transmitter.on_rc_channels(3 * S, 8, 0)
    assert transmitter.radio is Radio.LOST


def test_a_loss_is_made_good_from_a_second_after_the_last_override_on() -> None:
    for after_ns, radio in ((S - 1, Radio.LOST), (S, Radio.HEARD)):
        transmitter = Transmitter()
        transmitter.on_rc_channels(S, 8, 255)
        transmitter.on_sys_status(S, RECEIVER, 0)
        transmitter.note_override(10 * S)
        transmitter.on_sys_status(10 * S + after_ns, RECEIVER, RECEIVER)
        assert transmitter.radio is radio


# --- arming -------------------------------------------------------------------------------------------------


class Checked:
    def __init__(self) -> None:
        self.checks = ArmingChecks()

    def status(self, ok: bool | None) -> None:
        self.checks.on_sys_status(0 if ok is None else CHECKS, CHECKS if ok else 0)

    def say(self, t_ns: int, *texts: str) -> None:
        packer = Texts()
        for text in texts:
            for message in packer.messages(2, text):
                self.checks.on_text(t_ns, self._over_the_wire(message))

    @staticmethod
    def _over_the_wire(message: Any) -> Any:
        mav = dialect.MAVLink(None)
        return dialect.MAVLink(None).parse_buffer(message.pack(mav))[0]


def test_it_says_in_the_autopilots_words_why_it_would_not_arm() -> None:
    boat = Checked()
    assert boat.checks.fault(0) == "" and not boat.checks.is_due(0)
    boat.status(False)
    assert boat.checks.fault(0) == "its checks before arming fail"
    boat.say(S, "PreArm: Radio failsafe on", "EKF3 IMU0 is using GPS", "PreArm: GPS 1: Bad fix")
    assert boat.checks.fault(S) == "Radio failsafe on (and 1 more)"
    boat.say(31 * S, "PreArm: GPS 1: Bad fix")  # the next round: the first has been mended
    assert boat.checks.fault(31 * S) == "Radio failsafe on (and 1 more)", "the round is not over yet"
    assert boat.checks.fault(33 * S + 1) == "GPS 1: Bad fix"
    assert boat.checks.fault(70 * S) == "its checks before arming fail"  # it has not been repeated
    boat.status(True)
    assert boat.checks.fault(70 * S) == ""


def test_a_long_text_comes_in_pieces() -> None:
    boat = Checked()
    boat.status(False)
    boat.say(S, f"PreArm: {'x' * 90}")
    assert boat.checks.fault(S) == "x" * 90


def test_a_refused_attempt_is_told_for_a_while_though_all_checks_pass() -> None:
    boat = Checked()
    boat.status(True)
    boat.say(S, "Arm: Throttle (RC3) is not neutral")
    assert boat.checks.fault(9 * S) == "Throttle (RC3) is not neutral"
    assert boat.checks.fault(12 * S) == ""


def test_what_fails_is_asked_for_where_nothing_tells_it_and_not_too_often() -> None:
    boat = Checked()
    boat.status(None)
    assert not boat.checks.is_due(0)  # no checks: nothing to ask for
    boat.status(False)
    assert boat.checks.is_due(S) and not boat.checks.is_due(2 * S) and boat.checks.is_due(11 * S)
    boat.say(11 * S, "PreArm: Radio failsafe on")
    assert not boat.checks.is_due(25 * S)
    assert boat.checks.is_due(27 * S)  # it may have been mended
    boat.checks.restart()
    assert boat.checks.fault(60 * S) == "" and boat.checks.ok is None
