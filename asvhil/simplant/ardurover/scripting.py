"""Lua scripts on the simulated ArduRover: the scripts themselves, against a stand-in of ArduPilot's API. Sans-IO.

What a real one was seen to do is done here too: scripts are given messages with a wrong checksum and of anybody, all
scripts share one queue of messages, and an output is driven as told, disarmed or not, past its travel and its sense.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as dialect

from asvhil.config.shipped_script import CARD_FOLDER
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import CRC_LENGTH, HEADER_V2, MAGIC_V2, SIGNATURE_LENGTH, checksum, message_id
from asvhil.simplant.ardurover.parameters import OUTPUTS

RESTART_NS = 1_000_000_000  # from the end of scripting until it begins again
AGAIN_NS = 10_000_000_000  # between two times that an error is told
CRITICAL = dialect.MAV_SEVERITY_CRITICAL
ROVER = 1  # FWVersion:type()
MOST_MESSAGES = 25
PAYLOAD_SPACE = 264

# Loads one script with what ArduPilot gives it. Whole numbers are of 64 bits here, of 32 bits there.
SANDBOX = r"""
local api, text, name, steps = ...
local function uint32(n) return { toint = function() return n end } end
local env = {
  assert = assert, error = error, ipairs = ipairs, math = math, next = next, pairs = pairs, pcall = pcall,
  select = select, string = string, table = table, tonumber = tonumber, tostring = tostring, type = type,
  millis = function() return uint32(api.millis()) end,
  micros = function() return uint32(api.micros()) end,
  FWVersion = { type = function() return api.kind end },
  param = { get = function(_, key) return api.param(key) end },
  rc = { get_pwm = function(_, channel) return api.stick(channel) end },
  arming = { is_armed = function() return api.armed() end },
  vehicle = { get_mode = function() return api.mode() end },
  gcs = {
    send_text = function(_, severity, words) api.say(severity, words) end,
    send_named_float = function(_, key, value) api.named_float(key, value) end,
  },
  SRV_Channels = {
    get_emergency_stop = function() return api.emergency_stop() end,
    find_channel = function(_, motor) return api.find_channel(motor) end,
    set_output_pwm_chan_timeout = function(_, output, pulse, ms) api.put_out(output, pulse, ms) end,
  },
  mavlink = {
    init = function(_, depth, kinds) api.init(depth, kinds) end,
    register_rx_msgid = function(_, number) return api.register(number) end,
    receive_chan = function()
      local message, at = api.receive()
      if message then return message, 0, uint32(at) end
    end,
  },
}
local run, problem = load(text, '@' .. name, 't', env)
if not run then return nil, problem end
local late
local function over() late = true; debug.sethook(over, '', 1); error('Exceeded CPU time') end
return function()
  late = false
  local pass = coroutine.create(run)
  debug.sethook(pass, over, '', steps)
  local found = table.pack(coroutine.resume(pass))
  if late then return name .. ' exceeded time limit', nil end
  if not found[1] then return tostring(found[2]) end
  if found.n == 1 then return nil end
  if found.n ~= 3 then return name .. ' returned bad result count (' .. (found.n - 1) .. ')' end
  if type(found[3]) ~= 'number' then return name .. ' did not return a delay' end
  if type(found[2]) ~= 'function' then return name .. ' did not return a function' end
  run = found[2]
  return nil, found[3]
end
"""


class ScriptedVehicle(Protocol):
    """What scripts see of the vehicle."""

    t_ns: int
    power_on_ns: int
    armed: bool
    mode: int
    emergency_stop: bool

    def parameter(self, name: str) -> float | None: ...

    def stick_us(self, channel: int) -> int | None: ...

    def hold_output(self, index: int, pulse_us: int, timeout_ms: int) -> None: ...

    def say(self, severity: int, text: str) -> None: ...

    def named_float(self, name: str, value: float) -> None: ...


class _Script:
    def __init__(self, run: Callable[[], tuple[str | None, float | None]], due_ns: int) -> None:
        self.run, self.due_ns = run, due_ns


class Scripting:
    """All scripts of the folder, each run when it is due. Raises ConfigError where the Lua interpreter is missing."""

    def __init__(self, vehicle: ScriptedVehicle, files: Mapping[str, bytes]) -> None:
        self._vehicle, self._files = vehicle, files
        self._begins = vehicle.parameter("SCR_ENABLE") != 0.0  # at boot or never
        self._begin_ns: int | None = vehicle.t_ns if self._begins else None
        self._scripts: list[_Script] | None = None  # None: it does not run
        self._restarts = False
        self._queue: deque[tuple[bytes, int]] | None = None
        self._accepted: list[int] = []
        self._kinds = 0
        self._error: tuple[int, str] | None = None

    # --- from outside ----------------------------------------------------------------------------------------

    def command(self, action: float) -> bool:
        """MAV_CMD_SCRIPTING: to stop (2), or to stop and begin again (3)."""
        if action not in (2.0, 3.0):
            return False
        self._stop(begin_again=action == 3.0)
        return True

    @property
    def listening(self) -> bool:
        """Whether a script has ever asked for messages."""
        return self._queue is not None

    def message(self, frame: bytes) -> None:
        """A frame of the link, whatever its checksum; where nobody fetches them the queue is soon full."""
        if self._queue is None or message_id(frame) not in self._accepted or len(self._queue) == self._queue.maxlen:
            return
        self._queue.append((as_message(frame), self._since_boot_ns // 1_000_000))

    def run(self) -> None:
        """Run the scripts that are due, once each, the one that has waited longest first."""
        now_ns, enabled = self._vehicle.t_ns, self._vehicle.parameter("SCR_ENABLE") != 0.0
        if not enabled and self._scripts is not None:
            self._stop(begin_again=True)
        if enabled and self._begin_ns is not None and now_ns >= self._begin_ns:
            self._begin()
        if self._scripts:
            for script in sorted(self._scripts, key=lambda script: script.due_ns):
                if script.due_ns <= now_ns:
                    self._run(script)
        if self._error is not None and now_ns - self._error[0] >= AGAIN_NS:
            self._tell(self._error[1])

    # --- parts -----------------------------------------------------------------------------------------------

    @property
    def _since_boot_ns(self) -> int:
        return self._vehicle.t_ns - self._vehicle.power_on_ns

    def _stop(self, *, begin_again: bool) -> None:
        if self._scripts is not None:
            self._scripts = None
            self._vehicle.say(CRITICAL, "Scripting: stopped")
        self._restarts = begin_again
        self._begin_ns = self._vehicle.t_ns + RESTART_NS if begin_again and self._begins else None

    def _begin(self) -> None:
        if self._restarts:
            self._vehicle.say(CRITICAL, "Scripting: restarted")
        self._begin_ns = None
        self._scripts = []
        api = self._api()
        for path in sorted(self._files):
            name = path.removeprefix(f"{CARD_FOLDER}/")
            if (
                not path.startswith(f"{CARD_FOLDER}/")
                or "/" in name
                or name.startswith(".")
                or not name.endswith(".lua")
            ):
                continue
            made = sandboxed(api, self._files[path].decode("latin-1"), f"scripts/{name}", self._steps)
            if isinstance(made, str):
                self._tell(f"Error: {made}")
            else:
                self._scripts.append(_Script(made, self._vehicle.t_ns))

    @property
    def _steps(self) -> int:
        return max(1000, int(self._vehicle.parameter("SCR_VM_I_COUNT") or 0))

    def _run(self, script: _Script) -> None:
        assert self._scripts is not None
        problem, delay_ms = script.run()
        if problem is not None:
            self._tell(problem)
        if delay_ms is None:
            self._scripts.remove(script)
        else:
            script.due_ns = self._vehicle.t_ns + round(delay_ms) * 1_000_000

    def _tell(self, problem: str) -> None:
        self._vehicle.say(CRITICAL, f"Lua: {problem}")
        self._error = self._vehicle.t_ns, problem

    # --- the API of scripts ----------------------------------------------------------------------------------

    def _api(self) -> dict[str, Any]:
        vehicle = self._vehicle
        return {
            "kind": ROVER,
            "millis": lambda: self._since_boot_ns // 1_000_000,
            "micros": lambda: self._since_boot_ns // 1_000,
            "armed": lambda: vehicle.armed,
            "mode": lambda: vehicle.mode,
            "emergency_stop": lambda: vehicle.emergency_stop,
            "param": vehicle.parameter,
            "stick": vehicle.stick_us,
            "find_channel": self._find_channel,
            "put_out": vehicle.hold_output,
            "say": lambda severity, text: vehicle.say(severity, text),
            "named_float": vehicle.named_float,
            "init": self._init,
            "register": self._register,
            "receive": self._receive,
        }

    def _find_channel(self, motor: int) -> int | None:
        numbers = range(OUTPUTS)
        return next((n for n in numbers if self._vehicle.parameter(f"SERVO{n + 1}_FUNCTION") == motor), None)

    def _init(self, depth: int, kinds: int) -> None:
        """The first call of all scripts sets the queue's depth, and each forgets what was registered."""
        if self._queue is None:
            self._queue = deque(maxlen=min(depth, MOST_MESSAGES))
        self._kinds = min(kinds, MOST_MESSAGES)
        self._accepted.clear()

    def _register(self, number: int) -> bool:
        if number in self._accepted:
            return False
        if len(self._accepted) >= self._kinds:
            raise RuntimeError("no registrations free")
        self._accepted.append(number)
        return True

    def _receive(self) -> tuple[str, int] | None:
        if self._queue is None:
            raise RuntimeError("RX not initialized")
        if not self._queue:
            return None
        message, milliseconds = self._queue.popleft()
        return message.decode("latin-1"), milliseconds


def sandboxed(
    api: dict[str, Any], text: str, name: str, steps: int
) -> Callable[[], tuple[str | None, float | None]] | str:
    """A script in an interpreter of its own, each call of which runs it once for (error, delay in ms); or its error."""
    try:
        from lupa.lua53 import LuaRuntime
    except ImportError:
        raise ConfigError(
            "scripts on the simulated ArduRover need the Lua interpreter: pip install '.[sim]' in the clone of asvhil"
        ) from None
    lua = LuaRuntime(encoding="latin-1", register_eval=False, register_builtins=False, unpack_returned_tuples=True)
    found = lua.execute(SANDBOX, lua.table_from(api), text, name, steps)
    if isinstance(found, tuple):
        return str(found[1])

    def run() -> tuple[str | None, float | None]:
        outcome = found()
        return outcome if isinstance(outcome, tuple) else (outcome, None)

    return run


def as_message(frame: bytes) -> bytes:
    """A MAVLink 2 frame as `receive_chan` gives it: ArduPilot's mavlink_message_t, with zeros for what was left out."""
    payload_end = HEADER_V2 + frame[1]
    payload = frame[HEADER_V2:payload_end].ljust(PAYLOAD_SPACE, b"\0")
    rest = frame[payload_end:].ljust(CRC_LENGTH + SIGNATURE_LENGTH, b"\0")
    return rest[:CRC_LENGTH] + frame[:HEADER_V2] + payload + rest


def whole_but_damaged(data: bytes) -> bytes | None:
    """A chunk that is one MAVLink 2 frame by its length, and has a wrong checksum; the real one hands it to scripts."""
    if len(data) < HEADER_V2 + CRC_LENGTH or data[0] != MAGIC_V2:
        return None
    body_end = HEADER_V2 + data[1]
    if len(data) not in (body_end + CRC_LENGTH, body_end + CRC_LENGTH + SIGNATURE_LENGTH):
        return None
    if (
        message_id(data) not in dialect.mavlink_map
        or checksum(data[:body_end]) == data[body_end : body_end + CRC_LENGTH]
    ):
        return None
    return data
