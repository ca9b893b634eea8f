"""The script on an ArduRover as the way to the motors: sessions of orders, and what its alive sign tells. Sans-IO.

The rules of the script are in `firmware/ardupilot_script/asvhil.lua`; docs/autopilot-script.md has them in words.
"""

from __future__ import annotations

from typing import Any

from asvhil.autopilot.motor_outputs import LAST_NEUTRALS, LAST_RELEASES
from asvhil.autopilot.script_protocol import (
    SENDERS,
    TEXTS,
    VERSION,
    AliveSign,
    Order,
    ScriptReason,
    ScriptState,
    encode_order,
)
from asvhil.autopilot.wiring import Pulses, Wiring
from asvhil.config import AutopilotLinkConfig, PwmConfig
from asvhil.errors import ConfigError
from asvhil.io.mavlink.frames import dialect, pack
from asvhil.supervisor.reasons import Explanation, Reason, explain

MODE = "HOLD"  # the only one that the script drives in
SILENT_NS = 2_000_000_000  # four alive signs
BEGINS_NS = 1_500_000_000  # from the first order until the alive sign must tell of its session
OLD_NS = 700_000_000  # a reason told so soon after the first order may be of before


class ScriptOutput:
    """Orders in sessions: one begins with the number that the alive sign tells, and ends with whatever ends it.

    What ended a session stands as `fault` until the motors are released.
    """

    hazard = refused = ""

    def __init__(self, config: AutopilotLinkConfig, pwm: PwmConfig, wiring: Wiring) -> None:
        """ConfigError for an identity that the script does not listen to."""
        if config.component_id not in SENDERS:
            first, last = SENDERS[0], SENDERS[-1]
            raise ConfigError(f"key links.autopilot.component_id: output script needs one from {first} to {last}")
        if config.system_id != config.autopilot_system_id:
            raise ConfigError("key links.autopilot.system_id: output script needs that of the autopilot")
        self.wiring = wiring
        self._sender = (config.system_id, config.component_id)
        self._target = (config.autopilot_system_id, config.autopilot_component_id)
        self._mav = dialect.MAVLink(None, srcSystem=config.system_id, srcComponent=config.component_id)
        self._neutral_us = pwm.neutral_us
        self._alive = AliveSign()
        self._since_ns: int | None = None  # when the autopilot was heard first, or again
        self._t_ns = 0
        self._can_begin = False  # an order before the vehicle is armed and in HOLD would use up its session
        self._start: int | None = None  # of the session
        self._used_start: int | None = None
        self._begun_ns = 0
        self._count = 0
        self._driven = False  # the alive sign has told of the session
        self._ended: Explanation | None = None

    # --- in ------------------------------------------------------------------------------------------------

    def on_connect(self, t_ns: int) -> None:
        """The autopilot or the link was gone: what the script told holds no more."""
        self._alive.forget()
        self._since_ns = t_ns
        self._start = self._used_start = None

    def on_disarmed(self, t_ns: int) -> None:
        """The script ends its session by itself."""
        self._can_begin = False

    def on_vehicle(self, *, armed: bool, mode: str) -> None:
        """What the autopilot's heartbeat tells."""
        self._can_begin = armed and mode == MODE

    def receive(self, acknowledgement: Any) -> None:
        """Orders are never acknowledged."""

    def on_named_value(self, t_ns: int, message: Any) -> None:
        """A NAMED_VALUE_FLOAT of the autopilot."""
        state = self._alive.state if self._alive.receive(t_ns, message) else None
        if state is None or self._start is None or state.start == self._start:
            return
        if state.driving:
            self._driven = True
        elif self._driven or (t_ns - self._begun_ns > OLD_NS and state.reason is not ScriptReason.READY):
            # "Ready" beside the next start is of before: the message with the reason was lost, that with the start not.
            self._ended = explain(Reason.SCRIPT_LET_GO, why=_why(state))

    def fault(self, t_ns: int) -> Explanation | None:
        """Why the script does not drive the motors, or would not."""
        heard_ns = self._alive.heard_ns if self._alive.heard_ns is not None else self._since_ns
        state = self._alive.state
        if heard_ns is None or t_ns - heard_ns > SILENT_NS:
            return explain(Reason.SCRIPT_SILENT)
        if state is not None and state.version != VERSION:
            return explain(Reason.SCRIPT_VERSION, found=state.version, needed=VERSION)
        if self._ended is not None:
            return self._ended
        unheard = self._start is not None and not self._driven and t_ns - self._begun_ns > BEGINS_NS
        return explain(Reason.SCRIPT_STARVED) if unheard else None

    # --- out -----------------------------------------------------------------------------------------------

    def drive(self, port_us: int, starboard_us: int) -> list[bytes]:
        """An order; none before the script has told a start that is still good, and could take it."""
        if self._start is None and not self._begin():
            return []
        return self._order(Order.DRIVE, self.wiring.to_outputs((port_us, starboard_us)))

    def release(self, t_ns: int) -> list[bytes]:
        """Give the outputs back; without an order they are HOLD's own after 0.3 s, so a lost one does no harm."""
        if self._start is None:
            return []
        released = self._order(Order.RELEASE, self.wiring.to_outputs((self._neutral_us, self._neutral_us)))
        self._used_start, self._start = self._start, None
        self._ended = None
        return released

    def last_words(self, *, neutral: bool) -> list[list[bytes]]:
        """Orders of the session for neutral, then its end; nothing where there is no session."""
        if self._start is None:
            return []
        pulses_us = self.wiring.to_outputs((self._neutral_us, self._neutral_us))
        orders = [Order.DRIVE] * (LAST_NEUTRALS if neutral else 0) + [Order.RELEASE] * LAST_RELEASES
        return [[self._encode(order, self._count + 1 + i, pulses_us)] for i, order in enumerate(orders)]

    def data_to_send(self, t_ns: int) -> list[bytes]:
        """Nothing but orders; notes the time."""
        self._t_ns = t_ns
        return []

    # --- parts ---------------------------------------------------------------------------------------------

    def _begin(self) -> bool:
        state = self._alive.state
        if state is None or not self._can_begin or state.start == self._used_start:
            return False
        self._start, self._begun_ns, self._count = state.start, self._t_ns, 0
        self._driven, self._ended = False, None
        return True

    def _order(self, order: Order, pulses_us: Pulses) -> list[bytes]:
        self._count += 1
        return [self._encode(order, self._count, pulses_us)]

    def _encode(self, order: Order, count: int, pulses_us: Pulses) -> bytes:
        assert self._start is not None
        message = encode_order(
            order,
            start=self._start,
            count=count,
            pulses_us=pulses_us,
            sender=self._sender,
            target=self._target,
        )
        return pack(message, self._mav)


def _why(state: ScriptState) -> str:
    return "an unknown reason" if state.reason is None else TEXTS[state.reason]
