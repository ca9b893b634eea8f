"""Puts the script on the autopilot, looks after it, and takes it away again: by MAVFTP, over the daemon's own link."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from asvhil.autopilot.script_protocol import VERSION, ScriptState
from asvhil.config import Config
from asvhil.config.ports import AUTOPILOT
from asvhil.config.shipped_script import CARD_FOLDER, NAME
from asvhil.errors import AsvhilError, LinkError
from asvhil.io.mavlink.file_client import (
    FileRefused,
    FilesUnanswered,
    Steps,
    list_folder,
    read_file,
    remove_file,
    rename_file,
    write_file,
)
from asvhil.io.mavlink.file_transfer import DATA_BYTES, FileRefusal
from asvhil.io.mavlink.frames import dialect
from asvhil.preflight.script_visit import CHECKS, ENABLE, SKIPPED, ScriptVisit
from asvhil.preflight.visit import Visit, in_brackets, unopened_text
from asvhil.types import record

PART = "asvhil.part"  # while it is written: nothing that a script engine loads
FOLDERS = (CARD_FOLDER, "scripts")  # on boards with a memory card; on Linux, from where ArduPilot runs
SCRIPTING_CHECK = 1 << 13  # of ARMING_CHECK and ARMING_SKIPCHK
TICK_S = 0.01
BROKEN_S = 2.0  # a link that cannot be opened is told after this
PARAMETERS_S = 25.0
ALIVE_S = 15.0  # of a script that has been restarted
LISTEN_S = 2.5  # to a script that may not be there
ACCEPTED = int(dialect.MAV_RESULT_ACCEPTED)

Progress = Callable[[str, float], None]


@record
class ScriptStatus:
    """What is on the autopilot. `installed` is the version of the file, None where there is none."""

    folder: str
    installed: int | None
    same: bool  # byte for byte, as the one that comes with this program
    state: ScriptState | None  # its alive sign, if it gives one
    enabled: bool | None  # SCR_ENABLE; None where it is not known
    checked: bool | None  # whether the autopilot does not arm when a script fails
    rivals: tuple[str, ...]  # other scripts that receive MAVLink messages
    problem: str  # what scripting says of a script that fails


def version_of(text: str) -> int | None:
    """The version that a script's text has; None where it is none of ours."""
    found = re.search(r"^local VERSION = (\d+)$", text, re.MULTILINE)
    return int(found[1]) if found else None


class ScriptTool:
    """One job on the vehicle. Raises LinkError where the autopilot is not heard, and AsvhilError in one line else."""

    def __init__(
        self,
        config: Config,
        timeout_s: float = 15.0,
        on_progress: Progress = lambda stage, share: None,
        visit: Visit | None = None,
    ) -> None:
        self._endpoint = config.links.autopilot.endpoint
        self._own = config.links.autopilot
        self._timeout_s = timeout_s
        self._on_progress = on_progress
        self._look = ScriptVisit(config)
        self._visit = visit or Visit(config, (AUTOPILOT,))

    async def install(self, text: str) -> ScriptStatus:
        """Write the script, read it back, restart scripting and wait until it runs."""
        async with self._visit:
            await self._hear()
            self._refuse_armed()
            await self._read_parameters()
            if not self._enabled:
                raise AsvhilError(self._why_no_scripting())
            folder, names = await self._folder()
            rivals = await self._rivals(folder, names)
            if rivals:
                raise AsvhilError(
                    f"{folder}/{rivals[0]}: this script receives MAVLink messages too, and all scripts share one "
                    "queue: each would get some; remove it first"
                )
            data, path, part = text.encode("ascii"), f"{folder}/{NAME}", f"{folder}/{PART}"
            await self._files(f"write {part}", write_file(part, data), "writing the script", len(data))
            if await self._files(f"read {part}", read_file(part), "reading it back", len(data)) != data:
                await self._files(f"remove {part}", remove_file(part), "")
                raise AsvhilError(f"{part}: what was read back is not what was written; nothing is changed, try again")
            if NAME in names:
                await self._files(f"remove {path}", remove_file(path), "")
            await self._files(f"rename {part}", rename_file(part, path), "")
            await self._restart()
            alive = self._look.alive
            if not await self._until(lambda: alive.state is not None, ALIVE_S, "waiting for its alive sign"):
                said = f"; the autopilot says: {self._look.problem}" if self._look.problem else ""
                raise AsvhilError(f"{path}: written, and it gives no sign of life within {ALIVE_S:.0f} s{said}")
            return self._status(folder, text, text, ())

    async def status(self, text: str) -> ScriptStatus:
        """What is there now; nothing is changed."""
        async with self._visit:
            await self._hear()
            await self._until(lambda: self._look.alive.state is not None, LISTEN_S, "listening for its alive sign")
            await self._read_parameters()
            folder, names = await self._folder()
            found = None
            if NAME in names:
                what, size = f"read {folder}/{NAME}", names[NAME]
                data = await self._files(what, read_file(f"{folder}/{NAME}"), "reading the script", size)
                found = data.decode("latin-1")
            return self._status(folder, text, found, await self._rivals(folder, names))

    async def remove(self) -> str:
        """Remove the file and restart scripting; its path. It is no error where it is not there."""
        async with self._visit:
            await self._hear()
            self._refuse_armed()
            await self._read_parameters()
            folder, names = await self._folder()
            if NAME not in names:
                return ""
            await self._files(f"remove {folder}/{NAME}", remove_file(f"{folder}/{NAME}"), "removing the script")
            if self._enabled:
                await self._restart()
                quiet_ns = round(LISTEN_S * 1e9)
                if not await self._until(lambda: self._look.quiet_ns > quiet_ns, ALIVE_S, "seeing that it is silent"):
                    raise AsvhilError(f"{folder}/{NAME}: removed, and it still runs: restart the autopilot")
            return f"{folder}/{NAME}"

    # --- parts -----------------------------------------------------------------------------------------------

    async def _until(self, condition: Callable[[], bool], timeout_s: float, stage: str) -> bool:
        """Carry messages until a condition holds; whether it does."""
        start_ns: int | None = None
        while not condition():
            t_ns = await self._visit.tick(self._look.step, TICK_S)
            start_ns = t_ns if start_ns is None else start_ns
            waited_s = 1e-9 * (t_ns - start_ns)
            if waited_s > timeout_s:
                return condition()
            self._on_progress(stage, min(waited_s / timeout_s, 1.0))
        return True

    async def _hear(self) -> None:
        stage = "waiting for the autopilot's heartbeat"
        heard = await self._until(lambda: self._look.armed is not None, BROKEN_S, stage)
        state = self._visit.states()[AUTOPILOT]
        if not heard and state not in ("up", "connecting"):
            raise LinkError(unopened_text(state))
        if heard or await self._until(lambda: self._look.armed is not None, self._timeout_s - BROKEN_S, stage):
            return
        dropped = in_brackets(self._visit.remarks(AUTOPILOT))
        who = f"{self._own.autopilot_system_id}/{self._own.autopilot_component_id}"
        what = f"{self._look.heard} bytes came, and no heartbeat of {who}" if self._look.heard else "nothing was heard"
        raise LinkError(
            f"{self._endpoint}: {what} within {self._timeout_s:.0f} s: is the autopilot on and wired?{dropped}"
        )

    def _refuse_armed(self) -> None:
        if self._look.armed:
            raise AsvhilError("the vehicle is armed: its scripts are not touched; disarm it first")

    async def _read_parameters(self) -> None:
        await self._until(lambda: self._look.parameters.complete, PARAMETERS_S, "reading parameters")

    @property
    def _enabled(self) -> bool | None:
        value = self._look.parameters.values.get(ENABLE)
        return None if value is None else value != 0.0

    def _why_no_scripting(self) -> str:
        if self._enabled is None:
            return f"the autopilot tells no {ENABLE}: its firmware has no scripting, or the link loses too much"
        return f"{ENABLE} is 0: the autopilot runs no scripts; set it to 1 and restart the autopilot, then try again"

    async def _folder(self) -> tuple[str, dict[str, int]]:
        for folder in FOLDERS:
            try:
                found: dict[str, int] = await self._files(
                    f"list {folder}", list_folder(folder), "looking at the scripts"
                )
                return folder, found
            except FileRefused as error:
                if error.code not in (FileRefusal.FILE_NOT_FOUND, FileRefusal.FAIL, FileRefusal.FAIL_ERRNO):
                    raise
        raise AsvhilError(
            f"the autopilot has no folder for scripts ({' or '.join(FOLDERS)}): has it a memory card, and was it "
            f"restarted since {ENABLE} is 1?"
        )

    async def _rivals(self, folder: str, names: dict[str, int]) -> tuple[str, ...]:
        found = []
        for name in sorted(names):
            if name.endswith(".lua") and name != NAME:
                what = f"read {folder}/{name}"
                data = await self._files(what, read_file(f"{folder}/{name}"), f"looking at {name}", names[name])
                found += [name] if b"receive_chan" in data else []
        return tuple(found)

    async def _files(self, what: str, steps: Steps, stage: str, size: int = 0) -> Any:
        files = self._look.files
        before, parts = files.answers, math.ceil(size / DATA_BYTES) + 3
        files.begin(what, steps)
        while files.busy:
            if stage:
                self._on_progress(stage, min((files.answers - before) / parts, 1.0))
            await self._visit.tick(self._look.step, TICK_S)
        try:
            return files.result()
        except FilesUnanswered as error:
            raise LinkError(
                f"{error}: is MAVFTP off, or held back on the way? `asvhil script install --copy-to FILE` writes the "
                "file for its memory card"
            ) from None

    async def _restart(self) -> None:
        self._look.restart_scripting()
        await self._until(lambda: not self._look.restarting, PARAMETERS_S, "restarting scripting")
        result = self._look.restart_result
        if result is None:
            raise LinkError("the file is changed, and the autopilot does not answer the command to restart its scripts")
        if result != ACCEPTED:
            raise AsvhilError(
                f"the file is changed, and the autopilot refuses to restart its scripts (result {result})"
            )

    def _status(self, folder: str, text: str, found: str | None, rivals: tuple[str, ...]) -> ScriptStatus:
        values = self._look.parameters.values
        checked: bool | None = None
        if CHECKS in values:
            checked = bool(int(values[CHECKS]) & (SCRIPTING_CHECK | 1))
        elif SKIPPED in values:
            checked = values[SKIPPED] >= 0.0 and not int(values[SKIPPED]) & SCRIPTING_CHECK
        return ScriptStatus(
            folder=folder,
            installed=None if found is None else version_of(found) or 0,
            same=found == text,
            state=self._look.alive.state,
            enabled=self._enabled,
            checked=checked,
            rivals=rivals,
            problem=self._look.problem,
        )


def advice(status: ScriptStatus) -> list[str]:
    """What is wrong, each with what to do; nothing where all is well."""
    found = []
    if status.enabled is False:
        found.append(f"{ENABLE} is 0: no script runs; set it to 1 and restart the autopilot")
    if status.installed is None:
        found.append("it is not installed: `asvhil script install`")
    elif not status.same:
        old = f"version {status.installed}" if status.installed != VERSION else "another text of the same version"
        found.append(f"the file is {old}, not the one of this program (version {VERSION}): install it again")
    if status.installed is not None and status.enabled and status.state is None:
        said = f": {status.problem}" if status.problem else "; see the texts of the autopilot"
        found.append(f"it does not run{said}")
    if status.state is not None and status.state.version != VERSION:
        found.append(f"version {status.state.version} runs: install it again, which restarts scripting")
    found += [f"{name} receives MAVLink messages too, and takes some of ours: remove it" for name in status.rivals]
    return found
