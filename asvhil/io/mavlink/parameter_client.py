"""The client of the parameter protocol: parameters are read by name, kept, changed and read back. Sans-IO."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping
from typing import Any

from asvhil.io.mavlink.frames import dialect

SPACING_NS = 40_000_000  # between two requests: a slow radio must not drown in them
ANSWER_NS = 500_000_000
ATTEMPTS = 4  # of each name at least, before it is left alone for a while
MOST_ATTEMPTS = 40  # of each name, on the worst of links
MISSED = 1e-4  # chance that a name which exists has not been heard of after all attempts
AGAIN_NS = 30_000_000_000
DOUBLINGS = 4  # of that, each time that a name is silent which never answered, while others do
REFRESH_NS = 60_000_000_000  # a change that another station made may have been lost on the way
NEVER_NS = 2**63

_INTEGERS = {
    dialect.MAV_PARAM_TYPE_UINT8: "<Bxxx",
    dialect.MAV_PARAM_TYPE_INT8: "<bxxx",
    dialect.MAV_PARAM_TYPE_UINT16: "<Hxx",
    dialect.MAV_PARAM_TYPE_INT16: "<hxx",
    dialect.MAV_PARAM_TYPE_UINT32: "<I",
    dialect.MAV_PARAM_TYPE_INT32: "<i",
}


def from_wire(value: float, kind: int, *, bytewise: bool) -> float:
    """The value of a PARAM_VALUE: the float itself, or the integer whose bytes stand in its place."""
    form = _INTEGERS.get(kind) if bytewise else None
    return value if form is None else float(struct.unpack(form, struct.pack("<f", value))[0])


def to_wire(value: float, kind: int, *, bytewise: bool) -> float:
    """The float of a PARAM_SET. Raises ValueError where an integer type cannot hold the value."""
    form = _INTEGERS.get(kind) if bytewise else None
    if form is None:
        return value
    try:
        return float(struct.unpack("<f", struct.pack(form, round(value)))[0])
    except struct.error:
        raise ValueError(f"{value:g} does not fit the parameter's type") from None


class _Request:
    """How often a value was requested, and when it is requested again.

    `contradicted`: answers since a PARAM_SET that told another value, of which one may be of before it.
    """

    def __init__(self) -> None:
        self.attempts = 0
        self.rounds = 0
        self.due_ns = 0
        self.given_up = False
        self.contradicted = 0

    @property
    def refused(self) -> bool:
        """Whether a new value was not taken, as far as the answers tell."""
        return self.contradicted > 1


class ParameterClient:
    """Keeps a few parameters known, each under the names that firmware versions give it: the one that answers counts.

    Every name is asked for half a second apart, and if nothing comes again half a minute later, and then after twice as
    long each time, up to 8 minutes: four times on a link that answers every request, and on one that loses many as
    often as it takes to hear of nearly all that exist. What is known is asked for again once a minute, and any
    PARAM_VALUE that comes by is taken. A name that the autopilot says it does not have (PARAM_ERROR) is asked for no
    more. `bytewise`: the autopilot sends integers by their bytes
    (PX4), not as floats (ArduPilot).
    """

    def __init__(
        self, groups: Iterable[tuple[str, ...]], system_id: int, component_id: int = 1, *, bytewise: bool = False
    ) -> None:
        self._to = (system_id, component_id)
        self._groups: tuple[tuple[str, ...], ...] = ()
        self._group_of: dict[str, tuple[str, ...]] = {}
        self._bytewise = bytewise
        self._values: dict[str, float] = {}
        self._kinds: dict[str, int] = {}
        self._absent: set[str] = set()
        self._answered_attempts = self._answered_groups = 0
        self._asking: dict[tuple[str, ...], _Request] = {}
        self._silent: tuple[str, ...] | None = ()  # None where something has changed that it follows from
        self._next_ns = 0
        self._spoken_ns: int | None = None
        self._writes: dict[str, tuple[float, _Request]] = {}
        self.requests = 0
        self.changes = 0  # of what is known
        self.want(groups)

    def want(self, groups: Iterable[tuple[str, ...]]) -> None:
        """Keep these parameters known, in this order, and no others; of those of before what is known stays so."""
        wanted = tuple(dict.fromkeys(groups))
        if wanted == self._groups:
            return
        self._groups = wanted
        self._group_of = {name: group for group in wanted for name in group}
        self._asking = {group: self._asking.get(group) or _Request() for group in wanted}
        kept = {name: value for name, value in self._values.items() if name in self._group_of}
        self.changes += len(kept) != len(self._values)
        self._values = kept
        self._silent = None
        self._next_ns = 0

    def is_pending(self, name: str) -> bool:
        """Whether an answer is still waited for: it is wanted, not known, and not given up."""
        group = self._group_of.get(name)
        return group is not None and not self._is_done(group)

    def restart(self) -> None:
        """The autopilot has rebooted: ask for everything again; what was known stands until it is answered."""
        self._asking = {group: _Request() for group in self._groups}
        self._silent = None
        self._absent.clear()
        self._next_ns = 0

    def forget(self) -> None:
        """What was read proves nothing, as of an autopilot that was still setting itself up: ask for everything."""
        self._values.clear()
        self.changes += 1
        self.restart()

    @property
    def values(self) -> Mapping[str, float]:
        """What is known, by the name that answered."""
        return self._values

    @property
    def complete(self) -> bool:
        """Whether every parameter is known, absent, or has been given up for now."""
        return all(self._is_done(group) for group in self._groups)

    @property
    def silent(self) -> tuple[str, ...]:
        """The first names of those that were given up: whether they exist, and what they are, is not known."""
        if self._silent is None:  # seldom, but it is asked for in each tick
            given_up = [group for group, asking in self._asking.items() if asking.given_up]
            self._silent = tuple(g[0] for g in given_up if not self._known(g) and not self._is_absent(g))
        return self._silent

    def receive(self, t_ns: int, message: Any) -> None:
        """A PARAM_VALUE of the autopilot."""
        name = message.param_id
        group = self._group_of.get(name)
        if group is None:
            return
        value = from_wire(message.param_value, message.param_type, bytewise=self._bytewise)
        if not math.isfinite(value):
            return
        self.changes += self._values.get(name) != value
        self._values[name] = value
        self._silent = None
        self._kinds[name] = message.param_type
        self._absent.discard(name)
        asking = self._asking[group]
        if asking.attempts:
            self._answered_attempts += math.ceil(asking.attempts / len(group))
            self._answered_groups += 1
        asking.attempts, asking.given_up = 0, False
        asking.due_ns = t_ns + REFRESH_NS
        write = self._writes.get(name)
        if write is None:
            return
        if same_value(write[0], value):
            del self._writes[name]
        else:
            write[1].contradicted += write[1].attempts > 0

    def on_error(self, message: Any) -> None:
        """A PARAM_ERROR of the autopilot: it has no parameter of that name."""
        if message.error == dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST and message.param_id in self._group_of:
            self._absent.add(message.param_id)
            self._silent = None
            self.changes += 1

    def data_to_send(self, t_ns: int) -> list[Any]:
        """The message that is due, if one is: a PARAM_SET goes before what is only to be read."""
        if self._too_soon(t_ns):
            return []
        message = self._write_request(t_ns)
        if message is None:
            message = self._read_request(t_ns)
        return [] if message is None else [message]

    def _read_request(self, t_ns: int) -> Any | None:
        if t_ns < self._next_ns:
            return None
        for group in self._groups:
            asking = self._asking[group]
            if asking.due_ns > t_ns:
                continue
            names = tuple(name for name in group if name in self._values) or group
            if self._is_absent(group):
                asking.due_ns = NEVER_NS
                continue
            if asking.attempts >= self._enough * len(names):
                wait_ns = AGAIN_NS << min(asking.rounds, DOUBLINGS)
                if self._values and not self._known(group):
                    asking.rounds += 1  # PX4's simulation has no PWM_MAIN_MIN: do not ask for it without end
                asking.attempts, asking.given_up, asking.due_ns = 0, True, t_ns + wait_ns
                self._silent = None
                continue
            name = names[asking.attempts % len(names)]
            asking.attempts += 1
            whole_round = asking.attempts % len(names) == 0
            asking.due_ns = t_ns + (ANSWER_NS if whole_round else SPACING_NS)
            self._spoken_ns = t_ns
            self.requests += 1
            return dialect.MAVLink_param_request_read_message(*self._to, name.encode(), -1)
        self._next_ns = min((asking.due_ns for asking in self._asking.values()), default=NEVER_NS)
        return None

    # --- changes, which the daemon never asks for ----------------------------------------------------------

    def write(self, name: str, value: float) -> None:
        """Change a parameter that has been read; it is `writing` until it was read back.

        It becomes `unwritten` where another value is read back again and again. Where nothing is, it is `unconfirmed`,
        and no longer known: it may have been written.
        """
        self._writes[name] = (value, _Request())

    @property
    def writing(self) -> frozenset[str]:
        """Names whose new value has not come back yet, and may still."""
        return frozenset(name for name, (_, asking) in self._writes.items() if not asking.given_up)

    @property
    def unwritten(self) -> frozenset[str]:
        """Names that were read back with another value than was written."""
        return frozenset(n for n, (_, asking) in self._writes.items() if asking.given_up and asking.refused)

    @property
    def unconfirmed(self) -> frozenset[str]:
        """Names that were written and never read back."""
        return frozenset(n for n, (_, asking) in self._writes.items() if asking.given_up and not asking.refused)

    @property
    def _enough(self) -> int:
        """Attempts after which a name is given up, by how many requests it took until the others answered."""
        if not self._answered_groups:
            return ATTEMPTS
        unheard = 1.0 - min(self._answered_groups / self._answered_attempts, 1.0)
        if unheard == 0.0:
            return ATTEMPTS
        return min(max(ATTEMPTS, math.ceil(math.log(MISSED) / math.log(unheard))), MOST_ATTEMPTS)

    def _write_request(self, t_ns: int) -> Any | None:
        for name, (value, asking) in self._writes.items():
            if asking.given_up or asking.due_ns > t_ns:
                continue
            if asking.attempts >= (ATTEMPTS if asking.refused else self._enough):
                asking.given_up = True
                if not asking.refused:
                    self._forget(name)
                continue
            asking.attempts += 1
            asking.due_ns = t_ns + ANSWER_NS
            self._spoken_ns = t_ns
            kind = self._kinds.get(name, int(dialect.MAV_PARAM_TYPE_REAL32))
            wire_value = to_wire(value, kind, bytewise=self._bytewise)
            return dialect.MAVLink_param_set_message(*self._to, name.encode(), wire_value, kind)
        return None

    def _forget(self, name: str) -> None:
        """Whether a new value was taken is not known: ask."""
        self._values.pop(name, None)
        if name in self._group_of:
            self._asking[self._group_of[name]] = _Request()
        self._silent = None
        self._next_ns = 0
        self.changes += 1

    def _known(self, group: tuple[str, ...]) -> bool:
        return not self._values.keys().isdisjoint(group)  # looked up for each parameter in each tick

    def _is_absent(self, group: tuple[str, ...]) -> bool:
        return self._absent.issuperset(group)

    def _is_done(self, group: tuple[str, ...]) -> bool:
        return self._known(group) or self._is_absent(group) or self._asking[group].given_up

    def _too_soon(self, t_ns: int) -> bool:
        return self._spoken_ns is not None and 0 <= t_ns - self._spoken_ns < SPACING_NS


def same_value(a: float, b: float) -> bool:
    """Equal as the wire's 32-bit floats."""
    return math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-6)
