"""The vehicle inside the simulated ArduRover: modes and arming, and what becomes of the sticks in each of its loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config import FrontseatConfig, PwmConfig
from asvhil.config.autopilots import ARDUROVER_MODES
from asvhil.simplant.ardurover.arming import RudderWatch, checks_skipped, failing_checks, sticks_out
from asvhil.simplant.ardurover.failsafes import DISARM, FAILSAFE_ACTIONS, RadioWatch, StationWatch
from asvhil.simplant.ardurover.motors import SkidSteering
from asvhil.simplant.ardurover.outputs import ServoOutputs
from asvhil.simplant.ardurover.parameters import Parameters
from asvhil.simplant.vehicle.powered import PoweredVehicle
from asvhil.simplant.vehicle.rc import CHANNELS, IGNORE, RELEASE_HIGH

MODE_MANUAL, MODE_HOLD, MODE_INITIALISING = (ARDUROVER_MODES[name] for name in ("MANUAL", "HOLD", "INITIALISING"))
MODES = frozenset(ARDUROVER_MODES.values()) - {MODE_INITIALISING}
PILOTED_MODES = frozenset(ARDUROVER_MODES[name] for name in ("MANUAL", "ACRO", "STEERING", "HOLD", "SIMPLE"))
POSITION_MODES = MODES - PILOTED_MODES  # refused until the position is used
CHECKS_NS = 1_000_000_000  # between two rounds of the checks before arming
TELL_CHECKS_NS = 30_000_000_000  # between two times that it says what fails
CENTRED = (0.0, 0.0)
INFO, WARNING, CRITICAL = dialect.MAV_SEVERITY_INFO, dialect.MAV_SEVERITY_WARNING, dialect.MAV_SEVERITY_CRITICAL


class Rover(PoweredVehicle):
    """State and rules, without bytes.

    Modes other than MANUAL are entered and reported, but leave the motors neutral: navigation is not simulated.
    """

    def __init__(
        self, config: FrontseatConfig, pwm: PwmConfig, t_ns: int, speed_mps: Callable[[], float] = lambda: 0.0
    ) -> None:
        """`speed_mps`: that of the boat ahead, over ground; asked for only where steering is scaled by it."""
        super().__init__(config, t_ns)
        self._setup_ns = round(1e9 * config.setup_s)
        self.parameters = Parameters(config, pwm)
        self._speed_mps = speed_mps
        self._heard: tuple[int, int, int] | None = None  # parameters and radio by which the sticks are where they are
        self._sticks = CENTRED
        self.named_floats: list[tuple[str, float]] = []  # from scripts to the stations
        self._steering = SkidSteering(self.parameters, config.loop_hz)
        self.outputs = ServoOutputs(self.parameters, pwm, self.servo_us, config.loop_hz)
        self._radio = RadioWatch(config, self.parameters, self.rc, self.texts)
        self._station = StationWatch(self.parameters, self.texts)
        self.restart(t_ns)

    def restart(self, t_ns: int) -> None:
        """Power on: everything but the parameters and the pilot's sticks is reset."""
        super().restart(t_ns)
        self.mode = MODE_INITIALISING
        self.safety_on = self.parameters["BRD_SAFETY_DEFLT"] != 0.0
        if self._setup_ns:
            self.parameters.begin_setup()
        self._position_used = False
        self.checks_pass = False
        self._checked_ns = self._told_ns = self.boot_ns
        self._rudder = RudderWatch()
        self.emergency_stop = False
        self.named_floats.clear()
        self._radio.restart()
        self._station.restart()
        self._steering.stop()
        self.outputs.restart()

    @property
    def outputs_us(self) -> tuple[int, int]:
        """Pulse widths at the port and the starboard motor, as motors on plain outputs would get them (`WiredMotor`).

        0: no signal, as before boot or the safety switch.
        """
        return (0, 0) if self.safety_on else self.outputs.motors_us

    @property
    def radio_failsafe(self) -> bool:
        """Whether the radio's fail-safe has acted, and the radio is not back."""
        return self._radio.failsafe

    @property
    def gcs_failsafe(self) -> bool:
        """Whether the station's fail-safe has acted, and the station is not back."""
        return self._station.failsafe

    @property
    def radio_silent(self) -> bool:
        """Whether the radio has been silent for so long that sticks count as neutral."""
        return self._radio.silent

    def press_safety_switch(self) -> None:
        """The button on the boat: the outputs come alive."""
        self.safety_on = False

    @property
    def booted(self) -> bool:
        """Whether it is past its set-up."""
        return self.mode != MODE_INITIALISING

    def ready(self, t_ns: int) -> bool:
        """Whether the estimator uses its position."""
        return t_ns >= self.ready_ns

    def has_fix(self, t_ns: int) -> bool:
        """Whether the receiver has one: the estimator uses it at once."""
        return self.ready(t_ns)

    # --- a loop --------------------------------------------------------------------------------------------

    def begin(self, t_ns: int) -> None:
        """The start of a loop, before messages are handled; never before `boot_ns`."""
        self.t_ns = t_ns
        if self.mode == MODE_INITIALISING and t_ns >= self.boot_ns + self._setup_ns:
            self.parameters.end_setup()
            self.rc.last_input_ns = t_ns  # nobody has looked at the radio before
            self.mode = MODE_MANUAL
            self.texts.append((INFO, "ArduPilot Ready"))
        if not self._position_used and self.ready(t_ns):
            self._position_used = True
            self.texts.append((INFO, "EKF3 IMU0 is using GPS"))

    def end(self) -> None:
        """The end of a loop: time-outs, then the motors."""
        t_ns, parameters, booted = self.t_ns, self.parameters, self.mode != MODE_INITIALISING
        radio = self._radio
        self.rc.read()
        radio.look_at_throttle(t_ns, self.rc.radio_us[parameters.mapped[1] - 1])
        if booted and radio.advance(t_ns):
            self._fail_safe("Radio")
        able = booted and not self.armed and not radio.silent and parameters["ARMING_RUDDER"] != 0.0
        if self._rudder.asks(t_ns, self.sticks() if able else CENTRED):
            self.arm(by_rudder=True)
        if self._station.advance(t_ns):
            self._fail_safe("GCS")
        if t_ns - self._checked_ns >= CHECKS_NS:
            self._watch_checks()
        port = starboard = 0.0
        if self.armed and self.mode == MODE_MANUAL and not radio.silent:
            first, second = self.sticks()
            port, starboard = self._steering.throttles(first, second, self._speed_mps)
        else:
            self._steering.stop()
        self.outputs.put_out(port, starboard, armed=self.armed, emergency_stop=self.emergency_stop)

    def _fail_safe(self, what: str) -> None:
        self.texts.append((WARNING, f"{what} Failsafe"))
        self.rc.drop_overrides()
        for action in FAILSAFE_ACTIONS.get(int(self.parameters["FS_ACTION"]), ()):
            if self.disarm() if action == DISARM else self.enter_mode(action):
                return

    # --- sticks --------------------------------------------------------------------------------------------

    def heartbeat(self, sender_system: int) -> None:
        """A station's heartbeat; that of ours keeps its fail-safe away."""
        if self.parameters.is_station(sender_system):
            self._station.note(self.t_ns)

    def override(self, sender_system: int, values: Sequence[int]) -> None:
        """Channel overrides (16 raw values); those of other stations than ours are dropped without a word.

        They count as a heartbeat of the station.
        """
        if not self.parameters.is_station(sender_system):
            return
        self._station.note(self.t_ns)
        settings = self._radio.settings
        if not settings.overrides_ignored:
            self.rc.override(self.t_ns, values, settings.neutral_ns)

    def manual_control(self, sender_system: int, target: int, y: int, z: int) -> None:
        """MANUAL_CONTROL: y moves the stick of RCMAP_ROLL, z that of RCMAP_THROTTLE; -1000..1000 over its travel.

        32767 (no value) gives the channel back: ArduPilot overrides it with 0 then. One for everybody is for nobody.
        """
        if target != self._config.system_id:
            return
        values = [IGNORE] * CHANNELS
        for channel, axis in zip(self.mapped, (y, z), strict=True):
            values[channel - 1] = 0 if channel <= 8 else RELEASE_HIGH
            if axis != 32767:
                stick = self.parameters.stick(channel)
                share = (axis + 1000) / 2000
                values[channel - 1] = int(stick.low_us + (stick.high_us - stick.low_us) * share)
        self.override(sender_system, values)

    @property
    def mapped(self) -> tuple[int, int]:
        """The channels that drive."""
        return self.parameters.mapped

    def sticks(self) -> tuple[float, float]:
        """The two that drive, in [-1, 1]."""
        parameters, radio_us = self.parameters, self.rc.radio_us
        first, second = parameters.mapped
        heard = parameters.changes, radio_us[first - 1], radio_us[second - 1]
        if heard != self._heard:  # they stand for several loops
            self._heard = heard
            self._sticks = parameters.stick(first).fraction(heard[1]), parameters.stick(second).fraction(heard[2])
        return self._sticks

    # --- what scripts see and do -----------------------------------------------------------------------------

    def parameter(self, name: str) -> float | None:
        """The value of a parameter; None where there is none of that name."""
        return self.parameters.get(name)

    def stick_us(self, channel: int) -> int | None:
        """A channel of the transmitter, overridden or not; None where there is none, 0 without a signal."""
        return self.rc.radio_us[channel - 1] if 1 <= channel <= CHANNELS else None

    def hold_output(self, index: int, pulse_us: int, timeout_ms: int) -> None:
        """Drive an output (from 0) past everything, for a time (`ServoOutputs.hold`)."""
        self.outputs.hold(index, pulse_us, timeout_ms)

    def say(self, severity: int, text: str) -> None:
        """A text to all stations."""
        self.texts.append((severity, text))

    def named_float(self, name: str, value: float) -> None:
        """NAMED_VALUE_FLOAT to all stations."""
        self.named_floats.append((name, value))

    # --- modes and arming ----------------------------------------------------------------------------------

    def enter_mode(self, number: int) -> bool:
        """Change the mode; False, with the reason said, where the vehicle refuses."""
        if number not in MODES:
            self.texts.append((CRITICAL, f"No such mode {number}"))
            return False
        if self.mode == MODE_INITIALISING:
            return False
        if number in POSITION_MODES and not self.ready(self.t_ns):
            self.texts.append((WARNING, f"Mode change to {number} failed: requires position"))
            return False
        self.changed |= number != self.mode
        self.mode = number
        return True

    def arm(self, *, force: bool = False, by_rudder: bool = False) -> bool:
        """Arm; False, with the reasons said, where the vehicle refuses."""
        if self.armed:
            return True
        if not force and not self._may_arm(by_rudder):
            return False
        self.armed = self.changed = True
        self.texts.append((INFO, "Throttle armed"))
        return True

    def disarm(self) -> bool:
        """Disarm, always; the motors are neutral from the next loop."""
        if self.armed:
            self.armed = False
            self.changed = True
            self.texts.append((INFO, "Throttle disarmed"))
        return True

    def tell_checks(self) -> bool:
        """MAV_CMD_RUN_PREARM_CHECKS: say what fails; False while armed."""
        if self.armed:
            return False
        self._say("PreArm", self._failing_checks())
        return True

    @property
    def checks_skipped(self) -> bool:
        """Whether it arms without any checks."""
        return checks_skipped(self.parameters)

    def _watch_checks(self) -> None:
        """Once in `CHECKS_NS` look at what would keep it from arming, and say so twice a minute."""
        self._checked_ns = self.t_ns
        failing = self._failing_checks()
        self.checks_pass = not failing
        if failing and not self.armed and self.t_ns - self._told_ns >= TELL_CHECKS_NS:
            self._told_ns = self.t_ns
            self._say("PreArm", failing)

    def _failing_checks(self) -> list[str]:
        return failing_checks(
            self.t_ns,
            self.parameters,
            self.rc,
            booted=self.booted,
            safety_on=self.safety_on,
            position_used=self.ready(self.t_ns),
            radio_silent=self._radio.silent,
        )

    def _may_arm(self, by_rudder: bool) -> bool:
        """All checks, with the reasons said where one fails."""
        failing = self._failing_checks()
        if not failing and not self.checks_skipped:
            failing = sticks_out(self.t_ns, self.rc, self.mapped, self.sticks(), by_rudder=by_rudder)
        self._say("Arm", failing)
        return not failing

    def _say(self, when: str, failing: list[str]) -> None:
        """A check's own words for when it was made stand."""
        self.texts += [(CRITICAL, text if text.startswith("PreArm: ") else f"{when}: {text}") for text in failing]
