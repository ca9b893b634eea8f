"""`asvhil script` on the simulated ArduRover, in virtual time: what goes well, and each thing that can be wrong."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from typing import Any

import pytest

from asvhil.autopilot.script_protocol import ScriptReason
from asvhil.config import load_config
from asvhil.config.shipped_script import shipped_script
from asvhil.errors import AsvhilError, LinkError
from asvhil.preflight.script_checks import script_checks
from asvhil.preflight.script_tool import ScriptTool, advice, version_of
from asvhil.preflight.table import Result
from asvhil.types import Frame, Inputs
from tests.support.autopilot_script import NEUTRAL, NO_PILOT, PATH, SCRIPT, ScriptBoat, parameters
from tests.support.simplant_boat import Boat

RIVAL = "/APM/scripts/other.lua"


class VirtualVisit:
    """A link to a simulated boat, in virtual time."""

    def __init__(self, boat: Boat, silent: bool = False) -> None:
        self.boat, self.silent = boat, silent
        self.frames: tuple[Frame, ...] = ()

    async def __aenter__(self) -> VirtualVisit:
        return self

    async def __aexit__(self, *_: object) -> None: ...

    def states(self) -> dict[str, str]:
        return {"autopilot": "up"}

    def remarks(self, port: str) -> str:
        return ""

    async def tick(self, step: Callable[[Inputs], Iterable[Frame]], pause_s: float) -> int:
        boat = self.boat
        inputs = Inputs(t_ns=boat.t_ns, frames=self.frames)
        for frame in step(inputs):
            boat.plant.receive(Frame(t_ns=boat.t_ns, port="autopilot", data=frame.data, peer="companion"))
        boat.t_ns += round(1e9 * pause_s)
        came = [frame for frame in boat.plant.advance(boat.t_ns) if frame.port == "autopilot"]
        self.frames = () if self.silent else tuple(came)
        return inputs.t_ns


def fresh(*overrides: str, **more: float) -> Boat:
    boat = Boat(parameters(**more), *NO_PILOT, *overrides)
    boat.run(3.5)
    return boat


def tool(boat: Boat, said: list[str] | None = None, **visit: Any) -> ScriptTool:
    def note(stage: str, share: float) -> None:
        assert 0.0 <= share <= 1.0
        if said is not None and stage not in said:
            said.append(stage)

    return ScriptTool(load_config("field"), 15.0, note, VirtualVisit(boat, **visit))  # type: ignore[arg-type]


def test_it_is_installed_and_runs() -> None:
    boat, said = fresh(), []
    status = asyncio.run(tool(boat, said).install(SCRIPT))
    assert boat.seat.files == {PATH: SCRIPT.encode()}
    assert (status.installed, status.same, status.enabled, status.rivals) == (1, True, True, ())
    assert status.state is not None
    assert status.state.reason is ScriptReason.DISARMED
    assert advice(status) == []
    assert said == [
        "waiting for the autopilot's heartbeat",
        "reading parameters",
        "looking at the scripts",
        "writing the script",
        "reading it back",
        "restarting scripting",
        "waiting for its alive sign",
    ]


def test_another_version_is_replaced() -> None:
    old = SCRIPT.replace("local VERSION = 1\n", "local VERSION = 0\n")
    boat = ScriptBoat(old)
    before = asyncio.run(tool(boat).status(SCRIPT))
    assert (before.installed, before.same) == (0, False)
    assert advice(before) == [
        "the file is version 0, not the one of this program (version 1): install it again",
        "version 0 runs: install it again, which restarts scripting",
    ]
    status = asyncio.run(tool(boat).install(SCRIPT))
    assert status.state is not None
    assert status.state.version == 1
    assert list(boat.seat.files) == [PATH]


def test_status_of_one_that_runs() -> None:
    status = asyncio.run(tool(ScriptBoat()).status(SCRIPT))
    assert (status.folder, status.installed, status.same, status.checked) == ("/APM/scripts", 1, True, True)
    assert advice(status) == []


def test_status_changes_nothing_and_is_had_while_armed() -> None:
    boat = ScriptBoat().driving()
    boat.seat.scripting.command = None  # type: ignore[method-assign]
    asyncio.run(tool(boat).status(SCRIPT))
    assert boat.seat.files == {PATH: SCRIPT.encode()}


def test_status_of_none() -> None:
    status = asyncio.run(tool(fresh()).status(SCRIPT))
    assert (status.installed, status.state) == (None, None)
    assert advice(status) == ["it is not installed: `asvhil script install`"]


@pytest.mark.parametrize(
    ("version", "given", "checked"),
    [
        ("4.6", {"ARMING_CHECK": 4124}, False),
        ("4.6", {"ARMING_CHECK": 8192}, True),
        ("4.6", {"ARMING_CHECK": 1}, True),
        ("4.7", {"ARMING_SKIPCHK": 0}, True),
        ("4.7", {"ARMING_SKIPCHK": 1043938}, False),
        ("4.7", {"ARMING_SKIPCHK": -1}, False),
    ],
)
def test_whether_a_dead_script_stops_arming(version: str, given: dict[str, float], checked: bool) -> None:
    boat = ScriptBoat(SCRIPT, f"plant.frontseat.firmware='{version}'", **given)
    assert asyncio.run(tool(boat).status(SCRIPT)).checked is checked


def test_one_that_fails_is_told_in_its_own_words() -> None:
    boat = fresh()
    bad = SCRIPT + "\nreturn nothing.at_all\n"
    bad = bad.replace("return update()\n\nreturn", "return")
    with pytest.raises(
        AsvhilError, match=r"gives no sign of life within 15 s; the autopilot says: scripts/asvhil.lua:"
    ):
        asyncio.run(tool(boat).install(bad))
    status = asyncio.run(tool(boat).status(SCRIPT))
    assert "another text of the same version" in advice(status)[0]
    assert advice(status)[1].startswith("it does not run")


def test_removed_it_is_silent() -> None:
    boat = ScriptBoat()
    assert asyncio.run(tool(boat).remove()) == PATH
    assert boat.seat.files == {}
    boat.alive.forget()
    boat.run(2.0)
    assert boat.alive.state is None
    assert asyncio.run(tool(boat).remove()) == ""


def test_one_that_goes_on_after_it_was_removed() -> None:
    boat = ScriptBoat()
    boat.seat.scripting.command = lambda action: True  # the script is in memory still
    with pytest.raises(
        AsvhilError, match=r"^/APM/scripts/asvhil.lua: removed, and it still runs: restart the autopilot$"
    ):
        asyncio.run(tool(boat).remove())


def test_the_sign_of_an_old_one_is_not_taken_for_the_new() -> None:
    boat = ScriptBoat()
    told = boat.seat.rover.say
    boat.seat.rover.say = lambda severity, text: None if text == "Scripting: restarted" else told(severity, text)
    bad = SCRIPT.replace("local VERSION = 1", "local VERSION = nothing.at_all")
    with pytest.raises(AsvhilError, match="gives no sign of life"):
        asyncio.run(tool(boat).install(bad))


@pytest.mark.parametrize("job", ["install", "remove"])
def test_nothing_is_touched_on_an_armed_vehicle(job: str) -> None:
    boat = ScriptBoat().driving()
    jobs = tool(boat)
    with pytest.raises(AsvhilError, match=r"^the vehicle is armed: its scripts are not touched; disarm it first$"):
        asyncio.run(jobs.install(SCRIPT) if job == "install" else jobs.remove())
    assert boat.seat.files == {PATH: SCRIPT.encode()}


def test_scripting_that_is_off() -> None:
    boat = fresh(SCR_ENABLE=0)
    with pytest.raises(AsvhilError, match=r"^SCR_ENABLE is 0: the autopilot runs no scripts; set it to 1 and restart"):
        asyncio.run(tool(boat).install(SCRIPT))
    assert boat.seat.files == {}
    assert advice(asyncio.run(tool(boat).status(SCRIPT)))[0].startswith("SCR_ENABLE is 0")


def test_a_rival_for_the_queue_is_refused_by_name() -> None:
    boat = fresh()
    boat.seat.files[RIVAL] = b"mavlink:init(1, 1)\nlocal m = mavlink:receive_chan()\n"
    with pytest.raises(AsvhilError, match=r"^/APM/scripts/other.lua: this script receives MAVLink messages too"):
        asyncio.run(tool(boat).install(SCRIPT))
    assert list(boat.seat.files) == [RIVAL]
    assert asyncio.run(tool(boat).status(SCRIPT)).rivals == ("other.lua",)


def test_other_scripts_are_no_rivals() -> None:
    boat = fresh()
    boat.seat.files[RIVAL] = b"gcs:send_text(6, 'hello')\n" * 100
    asyncio.run(tool(boat).install(SCRIPT))
    assert set(boat.seat.files) == {RIVAL, PATH}


def test_no_room() -> None:
    boat = fresh()
    boat.seat.file_server.capacity = 3000
    with pytest.raises(LinkError, match=r"^write /APM/scripts/asvhil.part: no space left on device$"):
        asyncio.run(tool(boat).install(SCRIPT))
    assert PATH not in boat.seat.files


def test_no_file_transfer() -> None:
    boat = fresh()
    boat.seat.file_server.enabled = False
    with pytest.raises(LinkError, match=r"^list /APM/scripts: the autopilot does not answer: is MAVFTP off.*--copy-to"):
        asyncio.run(tool(boat).install(SCRIPT))


def test_what_reads_back_otherwise_is_not_used() -> None:
    boat = ScriptBoat()
    server = boat.seat.file_server
    write = server._write
    server._write = lambda offset, data: write(offset, data.replace(b"TIMEOUT_MS", b"TIMEOUT_XX"))
    with pytest.raises(AsvhilError, match=r"^/APM/scripts/asvhil.part: what was read back is not what was written"):
        asyncio.run(tool(boat).install(SCRIPT))
    assert boat.seat.files == {PATH: SCRIPT.encode()}


def test_no_folder() -> None:
    boat = fresh()
    boat.seat.file_server.folders.clear()
    with pytest.raises(
        AsvhilError, match=r"^the autopilot has no folder for scripts \(/APM/scripts or scripts\): has it"
    ):
        asyncio.run(tool(boat).install(SCRIPT))


def test_a_board_whose_folder_is_that_of_linux() -> None:
    boat = fresh()
    boat.seat.file_server.folders[:] = ["scripts"]
    with pytest.raises(AsvhilError, match=r"^scripts/asvhil.lua: written, and it gives no sign of life"):
        asyncio.run(tool(boat).install(SCRIPT))  # the simulated one looks into the other folder
    assert boat.seat.files == {"scripts/asvhil.lua": SCRIPT.encode()}


def test_nobody_there() -> None:
    with pytest.raises(LinkError, match=r"nothing was heard within 15 s: is the autopilot on and wired"):
        asyncio.run(tool(fresh(), silent=True).status(SCRIPT))


def test_a_rover_without_scripting() -> None:
    boat = fresh()
    names = boat.seat.rover.parameters.names
    boat.seat.rover.parameters.names = tuple(name for name in names if name != "SCR_ENABLE")
    boat.seat.rover.parameters._rows.pop("SCR_ENABLE")
    with pytest.raises(AsvhilError, match=r"^the autopilot tells no SCR_ENABLE: its firmware has no scripting"):
        asyncio.run(tool(boat).install(SCRIPT))


def test_a_boat_on_which_it_was_installed_is_driven() -> None:
    boat = ScriptBoat("return")
    assert boat.alive.state is None
    asyncio.run(tool(boat).install(SCRIPT))
    boat.armed().start()
    assert boat.motors != NEUTRAL


def test_a_boat_that_comes_with_it() -> None:
    card = Boat(parameters(), *NO_PILOT, "plant.frontseat.script=true").seat.files
    assert card == {PATH: SCRIPT.encode()}
    assert Boat(parameters(), *NO_PILOT).seat.files == {}


def test_the_shipped_script_and_its_version() -> None:
    assert shipped_script() == SCRIPT
    assert version_of(SCRIPT) == 1
    assert version_of("print(1)") is None


@pytest.mark.parametrize(
    ("boat", "files", "bad"),
    [
        ({}, {PATH: SCRIPT}, {}),
        ({}, {}, {"script's file": "`asvhil script install` puts it there"}),
        ({}, {PATH: SCRIPT + "-- mine"}, {"script's file": "`asvhil script install` replaces it"}),
        ({"ARMING_CHECK": 4124.0}, {PATH: SCRIPT}, {"a dead script": "set bit 13 (8192) of ARMING_CHECK"}),
        ({"ARMING_CHECK": 8192.0}, {PATH: SCRIPT}, {}),
        (
            {},
            {PATH: SCRIPT, RIVAL: "mavlink:receive_chan()"},
            {"scripts that take its messages": "all scripts share one queue"},
        ),
        ({}, {PATH: SCRIPT, RIVAL: "gcs:send_text(6, 'hello')"}, {}),
    ],
    ids=["well", "missing", "changed", "dead script arms", "bit 13", "rival", "no rival"],
)
def test_the_check_has_a_row_for_each_fact_with_what_to_do_and_writes_nothing(
    boat: dict[str, float], files: dict[str, str], bad: dict[str, str]
) -> None:
    made = fresh(**boat)
    made.seat.files.update({path: text.encode("ascii") for path, text in files.items()})
    before = dict(made.seat.files)
    rows = asyncio.run(script_checks(tool(made), shipped_script()))
    found = {row.item: row.todo for row in rows if row.result is not Result.PASS}
    assert set(found) == set(bad) and all(found[item].startswith(words) for item, words in bad.items())
    assert made.seat.files == before


@pytest.mark.parametrize(
    ("skipped", "result"), [(1043938, Result.WARN), (0, Result.PASS), (-1, Result.WARN), (8, Result.PASS)]
)
def test_since_4_7_the_bit_is_one_to_be_clear(skipped: int, result: Result) -> None:
    made = fresh("plant.frontseat.firmware='4.7'", ARMING_SKIPCHK=float(skipped))
    rows = {row.item: row.result for row in asyncio.run(script_checks(tool(made), shipped_script()))}
    assert rows["a dead script"] is result


def test_without_files_the_check_says_so_in_one_row() -> None:
    made = fresh()
    made.seat.file_server.enabled = False
    (row,) = asyncio.run(script_checks(tool(made), shipped_script()))
    assert row.result is Result.UNVERIFIED and "MAVFTP" in row.found
