"""The script on the simulated ArduRover as the way to the motors: held by it, given back, and refused by name."""

import pytest

from asvhil.config import load_config
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect
from asvhil.preflight.checks import checks_of
from asvhil.preflight.table import Result
from asvhil.supervisor.reasons import Reason, describe, explain
from asvhil.types import Frame, Phase
from tests.loop.test_wirings import BLUEBOAT, turns_as_commanded
from tests.support.autopilot_script import HOLD, MANUAL, NEUTRAL, PATH, SCRIPT
from tests.support.dock import Dock, bad, of
from tests.support.loop import DEFAULT_CONTROLLER, PLAIN_CONTROLLER, STATION_DEG, GroundStationLoop
from tests.support.settled import settled

WAY = ("links.autopilot.output=script", "plant.frontseat.script=true", "plant.frontseat.mygcs_system_id=255")


class ScriptLoop(GroundStationLoop):
    """A boat whose autopilot has the script and no parameter that the daemon asked for; armed in HOLD."""

    def __init__(self, *overrides: str, armed: bool = True, script: str | None = SCRIPT, **parameters: float) -> None:
        values = {"SCR_ENABLE": 1, "FS_THR_ENABLE": 0, **parameters}
        wired = f"plant.frontseat.parameters={values!r}".replace("'", "")
        settings = (
            PLAIN_CONTROLLER,
            "supervisor.engage=command",
            "plant.frontseat.rc_receiver=false",
            wired,
            *WAY,
            *overrides,
        )
        super().__init__(load_config("sitl", settings))
        if script is None:
            del self.frontseat.files[PATH]
        else:
            self.frontseat.files[PATH] = script.encode("ascii")
        self.wait(7.0)
        assert self.frontseat.set_mode(HOLD)
        if armed:
            assert self.frontseat.rover.arm(), self.frontseat.rover.texts
        self.wait(1.0)

    def held(self) -> "ScriptLoop":
        """On the way to the station, with motors that turn."""
        self.ask_to_hold(STATION_DEG, 0.0)
        assert self.results[-1] == 0, self.texts
        for _ in range(200):
            held = self.step().phase is Phase.HOLD
            if held and min(abs(pulse_us - 1500) for pulse_us in self.frontseat.outputs_us) > 30:
                return self
        raise AssertionError(f"the motors were not driven: {self.texts}")

    def ends(self, within_s: float) -> str:
        """The code of the reason for which the hold ends."""
        outputs = self.wait(within_s, until=lambda outputs: outputs.phase is Phase.STANDBY)
        assert outputs.phase is Phase.STANDBY and outputs.pwm_us is None
        return outputs.health.code


def test_the_station_is_kept() -> None:
    values = ", ".join(f"{name}: {value}" for name, value in {"SCR_ENABLE": 1, "FS_THR_ENABLE": 0}.items())
    steady = ("plant.frontseat.rc_receiver=false", "plant.sensors.gnss.slow_bias_m=0")  # the boat's distance alone
    config = load_config("sitl", (*WAY, f"plant.frontseat.parameters={{{values}}}", *steady))
    assert config.supervisor.control_mode == "HOLD"
    distance_m, heading_mean_deg, _ = settled(GroundStationLoop(config), 75.0, 50.0)
    assert distance_m <= 0.6 and abs(heading_mean_deg) <= 1.0


def test_a_blueboat_is_held_with_nothing_changed() -> None:
    loop = ScriptLoop(DEFAULT_CONTROLLER, **{name: float(value) for name, value in BLUEBOAT.items()}).held()
    turns_as_commanded(loop.plant, loop.step)
    notes = {note.subject: note for note in loop.step().health.notes}
    assert notes["outputs"].ok and "parameters" not in notes and loop.step().phase is Phase.HOLD


def test_the_motors_stop_by_themselves_when_the_daemon_dies() -> None:
    loop = ScriptLoop().held()
    loop.t_ns += 400_000_000
    loop.plant.advance(loop.t_ns)
    assert loop.frontseat.outputs_us == NEUTRAL
    loop.t_ns += 60_000_000_000
    loop.plant.advance(loop.t_ns)
    assert loop.frontseat.outputs_us == NEUTRAL and loop.frontseat.rover.armed


@pytest.mark.parametrize(
    ("act", "codes"),
    [
        ("disarm", {Reason.DISARMED, Reason.SCRIPT_LET_GO}),
        ("mode", {Reason.MODE_CHANGED, Reason.SCRIPT_LET_GO}),
        ("stick", {Reason.STICK_MOVED, Reason.SCRIPT_LET_GO}),
        ("emergency stop", {Reason.SCRIPT_LET_GO}),
    ],
)
def test_the_pilots_act_ends_the_hold_and_only_a_new_one_drives_again(act: str, codes: set[Reason]) -> None:
    loop = ScriptLoop("plant.frontseat.rc_receiver=true").held()
    seat = loop.frontseat
    match act:
        case "disarm":
            assert seat.arm(False)
        case "mode":
            assert seat.set_mode(MANUAL)
        case "stick":
            seat.set_sticks({3: 1700})
        case _:
            seat.rover.emergency_stop = True
    assert loop.ends(1.0) in codes
    assert seat.outputs_us == NEUTRAL
    seat.set_sticks({3: 1500})
    seat.rover.emergency_stop = False
    assert seat.set_mode(HOLD) and seat.rover.arm()
    loop.wait(3.0)
    assert seat.outputs_us == NEUTRAL, "nothing moves by itself"
    loop.held()


def test_a_release_gives_the_outputs_back_and_the_next_hold_is_a_new_session() -> None:
    loop = ScriptLoop().held()
    for _ in range(3):
        loop.say(
            dialect.MAVLink_command_long_message(1, 191, dialect.MAV_CMD_NAV_GUIDED_ENABLE, 0, 0, 0, 0, 0, 0, 0, 0)
        )
        assert loop.wait(0.5).phase is Phase.STANDBY and loop.frontseat.outputs_us == NEUTRAL
        loop.held()


@pytest.mark.parametrize(
    ("script", "why"),
    [
        (None, explain(Reason.SCRIPT_SILENT)),
        ("error('boom')", explain(Reason.SCRIPT_SILENT)),
        (SCRIPT.replace("local VERSION = 1", "local VERSION = 2"), explain(Reason.SCRIPT_VERSION, found=2, needed=1)),
    ],
    ids=["missing", "broken", "another version"],
)
def test_a_script_that_is_not_there_refuses_the_hold_by_name(script: str | None, why: object) -> None:
    loop = ScriptLoop(script=script)
    loop.ask_to_hold(STATION_DEG, 0.0)
    assert loop.results[-1] != 0
    assert describe(why) in loop.texts[-1]  # type: ignore[arg-type]


def test_a_script_that_dies_or_gets_no_orders_ends_the_hold_by_name() -> None:
    loop = ScriptLoop().held()
    loop.frontseat.scripting.command(2.0)
    assert loop.ends(4.0) in (Reason.SCRIPT_SILENT, Reason.OUTPUT_STUCK, Reason.OUTPUTS_DIFFER)
    assert loop.frontseat.outputs_us == NEUTRAL
    deaf = ScriptLoop()
    deaf.frontseat.scripting.message = lambda frame: None  # type: ignore[method-assign]
    deaf.ask_to_hold(STATION_DEG, 0.0)
    assert deaf.ends(4.0) in (Reason.SCRIPT_STARVED, Reason.OUTPUT_STUCK)


@pytest.mark.parametrize("there", [True, False])
def test_the_check_tells_of_the_script(there: bool) -> None:
    own = ("plant.frontseat.parameters={SCR_ENABLE: 1}", f"plant.frontseat.script={str(there).lower()}")
    dock = Dock(*WAY, *own)
    script = of(dock.look(), "script")
    assert script.result is (Result.PASS if there else Result.FAIL)
    assert bad(dock.look()) == ({} if there else {"script": Result.FAIL})


def test_the_check_warns_of_a_ground_station_that_is_not_heard() -> None:
    alone = ("plant.frontseat.rc_receiver=false", "plant.frontseat.parameters={SCR_ENABLE: 1}")
    dock = Dock(*WAY, *alone)
    assert of(dock.look(), "ground station").result is Result.WARN
    beat = dialect.MAVLink_heartbeat_message(dialect.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
    dock.survey.link.receive(
        Frame(t_ns=dock.t_ns, port="autopilot", data=bytes(beat.pack(dialect.MAVLink(None, 255, 190))))
    )
    assert of(checks_of(dock.survey), "ground station").result is Result.PASS


def test_scripts_that_are_off_are_a_parameter_to_be_set() -> None:
    loop = ScriptLoop(SCR_ENABLE=0.0)
    loop.ask_to_hold(STATION_DEG, 0.0)
    assert loop.results[-1] != 0 and "SCR_ENABLE is 0" in loop.texts[-1]


@pytest.mark.parametrize("override", ["links.autopilot.component_id=190", "links.autopilot.system_id=7"])
def test_an_identity_that_the_script_ignores_is_refused(override: str) -> None:
    with pytest.raises(ConfigError, match="output script needs"):
        ScriptLoop(override)
