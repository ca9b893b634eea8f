"""What the autopilot's parameters come to as they become known: the motors' wiring, and which are not as required."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from asvhil.autopilot.motor_outputs import Output
from asvhil.autopilot.requirements import Finding, Requirement, judge
from asvhil.autopilot.wiring import Wiring
from asvhil.io.mavlink.parameter_client import ParameterClient

Values = Mapping[str, float]  # of parameters, by name, as far as they are known


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRules:
    """What a vehicle profile makes of parameters. `optional`: only some versions of the firmware have them.

    `names_of_wiring` are the parameters that tell the wiring, `names_to_know` those that are asked for besides, each
    under the names that firmware versions give it. `receiver_ignored`: the autopilot is told to ignore its receiver, so
    that a transmitter has no effect. `fence_disarms`: whether a breach of the autopilot's own fence would disarm it, as
    far as is known. `trim_rad`: roll and pitch of the board over the axes whose attitude is told.
    """

    wiring: Callable[[Values], Wiring]
    requirements: Callable[[Values], tuple[Requirement, ...]] = lambda values: ()
    names_of_wiring: Callable[[Values], Iterable[str]] = lambda values: ()
    names_to_know: Callable[[Values], Iterable[tuple[str, ...]]] = lambda values: ()
    receiver_ignored: Callable[[Values], bool] = lambda values: False
    fence_disarms: Callable[[Values], bool] = lambda values: True
    trim_rad: Callable[[Values], tuple[float, float]] = lambda values: (0.0, 0.0)
    optional: frozenset[str] = frozenset()


class ParameterWatch:
    """Judges what has become known, and asks `client` for what follows from it.

    While the motors are driven the wiring stays as of when that began: what changes meanwhile is no news of the boat
    but a fault, which its outputs then show. `output` is told of a new wiring whenever the motors are not driven.
    """

    def __init__(self, rules: ParameterRules, client: ParameterClient, output: Output) -> None:
        self._rules = rules
        self._client = client
        self._output = output
        self._judged_changes = -1
        self._known_wiring = rules.wiring({})
        self._driven_wiring: Wiring | None = None  # that of the time when the motors were taken
        self._wiring_names: tuple[str, ...] = ()
        self._findings: list[Finding] = []
        self._receiver_ignored = False
        self._trim_rad, self._trim_changes = (0.0, 0.0), -1
        self._silent: tuple[str, ...] = ()  # as last told by `client`; what follows from it
        self._unread: tuple[str, ...] = ()
        self._unread_text = ""
        self._update()

    @property
    def findings(self) -> list[Finding]:
        """The required parameters, compared with what was read."""
        self._update()
        return self._findings

    @property
    def wiring(self) -> Wiring:
        """How the motors are wired, as far as is known; while they are driven, as of when that began."""
        if self._judged_changes != self._client.changes:
            self._update()
        return self._driven_wiring or self._known_wiring

    @property
    def unread_wiring(self) -> str:
        """The first parameter of the motors' wiring that is still waited for; empty where none is."""
        self._update()
        return next(filter(self._client.is_pending, self._wiring_names), "")

    @property
    def receiver_ignored(self) -> bool:
        """Whether the autopilot is told to ignore its receiver."""
        if self._judged_changes != self._client.changes:
            self._update()
        return self._receiver_ignored

    @property
    def fence_disarms(self) -> bool:
        """Whether a breach of the autopilot's own fence would disarm it, as far as is known."""
        return self._rules.fence_disarms(self._client.values)

    @property
    def trim_rad(self) -> tuple[float, float]:
        """Roll and pitch of the board over the axes whose attitude is told; 0 until it is known."""
        if self._trim_changes != self._client.changes:  # asked for with each attitude
            self._trim_changes, self._trim_rad = self._client.changes, self._rules.trim_rad(self._client.values)
        return self._trim_rad

    @property
    def unread(self) -> tuple[str, ...]:
        """Required parameters that were asked for often enough to be heard of, and have not answered."""
        silent = self._client.silent
        if silent is not self._silent:
            self._silent = silent
            self._unread = unread = tuple(name for name in silent if name not in self._rules.optional)
            more = f" and {len(unread) - 1} more" if len(unread) > 1 else ""
            self._unread_text = f"{unread[0]}{more}: no answer yet, unverified" if unread else ""
        return self._unread

    @property
    def unread_text(self) -> str:
        """The same for people; empty where there is none."""
        return self._unread_text if self.unread else ""

    @property
    def driven_wiring(self) -> Wiring | None:
        """The wiring by which the motors are driven; None while they are not."""
        return self._driven_wiring

    def begin_driving(self) -> Wiring:
        """The motors are commanded: the wiring stays as it is now, or as it was at the first such call."""
        if self._driven_wiring is None:
            self._driven_wiring = self.wiring
        return self._driven_wiring

    def end_driving(self) -> None:
        """The motors have been given back: the wiring is again what the parameters say."""
        self._driven_wiring = None
        self._output.wiring = self.wiring

    def _update(self) -> None:
        """Judge what has become known since the last time, if anything has."""
        if self._judged_changes == self._client.changes:
            return
        self._judged_changes = self._client.changes
        values = self._client.values
        self._known_wiring = self._rules.wiring(values)
        if self._driven_wiring is None:
            self._output.wiring = self._known_wiring
        self._wiring_names = tuple(dict.fromkeys(self._rules.names_of_wiring(values)))
        self._receiver_ignored = self._rules.receiver_ignored(values)
        required = self._rules.requirements(values)
        self._findings = judge(required, values)
        # Those of the wiring first, on which the others rest.
        names = [*((name,) for name in self._wiring_names), *(row.names for row in required)]
        self._client.want([*names, *self._rules.names_to_know(values)])
