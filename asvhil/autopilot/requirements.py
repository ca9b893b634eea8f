"""What the parameters of an autopilot must be, and what was found of them. Pure; each profile has its own list."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

from asvhil.types import Cause, record


@record
class Requirement:
    """One parameter under the names that firmware versions give it, and the values that will do.

    A value must lie within `least` and `most`, and not have any bit of `clear`. `wanted` is what to write where it does
    not, None where that is not ours to decide. With a `cause` a hold is refused; `must`: a preflight fails. `fault` is
    what happens, in a few words; `why` in more. `motor` is port or starboard, empty for both. `wiring`: it says how the
    boat is built, which is its builder's to know: `wanted` is what the config says, and is never written.
    """

    names: tuple[str, ...]
    least: float
    most: float
    wanted: float | None
    fault: str
    why: str
    cause: Cause | None = None
    must: bool = True
    motor: str = ""
    clear: int = 0
    wiring: bool = False


def within(
    names: str,
    limits: tuple[float, float],
    wanted: float | None,
    fault: str,
    why: str,
    cause: Cause | None = None,
    *,
    must: bool = True,
    clear: int = 0,
) -> Requirement:
    """A row of a profile's table: a value between two limits. `names` are separated by spaces."""
    least, most = limits
    return Requirement(
        names=tuple(names.split()),
        least=least,
        most=most,
        wanted=wanted,
        fault=fault,
        why=why,
        cause=cause,
        must=must,
        clear=clear,
    )


def exactly(
    names: str, value: float, fault: str, why: str, cause: Cause | None = None, *, must: bool = True
) -> Requirement:
    """A row of a profile's table: one value and no other."""
    return within(names, (value, value), value, fault, why, cause, must=must)


@record
class Finding:
    """What was found of one requirement: it is right (`ok`), `wrong`, or neither, which is `unverified`.

    What has not answered proves nothing: a parameter is unverified while its `value` is None. `wanted` is None where
    there is nothing to write.
    """

    requirement: Requirement
    name: str
    value: float | None
    wanted: float | None
    ok: bool

    @property
    def unverified(self) -> bool:
        """Whether it has not been read, which proves nothing."""
        return self.value is None

    @property
    def wrong(self) -> bool:
        """Whether it was read and will not do."""
        return not self.ok and not self.unverified

    @property
    def fixable(self) -> bool:
        """Whether it is wrong and `wanted` may be written: what has not answered and what is wiring is left alone."""
        return self.wrong and self.wanted is not None and not self.requirement.wiring

    @property
    def text(self) -> str:
        """In one line: for a refusal, and short enough for a STATUSTEXT."""
        value = f"{self.name} is {self.value:g}" if self.value is not None else f"{self.name} is not known"
        wanted = f", not {self.wanted:g}" if self.wanted is not None else ""
        return f"{value}{wanted}: {self.requirement.fault}"


def judge(required: Iterable[Requirement], values: Mapping[str, float]) -> list[Finding]:
    """A finding for each requirement, in order, of the values that were read."""
    return _see_swapped([_judge(requirement, values) for requirement in required])


def _judge(requirement: Requirement, values: Mapping[str, float]) -> Finding:
    name = next((name for name in requirement.names if name in values), requirement.names[0])
    value, wanted = values.get(name), requirement.wanted
    if value is None:
        return Finding(requirement=requirement, name=name, value=None, wanted=wanted, ok=False)
    ok = requirement.least <= value <= requirement.most
    if requirement.clear:
        wanted = float(int(value) & ~requirement.clear)
        ok = ok and wanted == value
    return Finding(requirement=requirement, name=name, value=value, wanted=wanted, ok=ok)


def _see_swapped(findings: list[Finding]) -> list[Finding]:
    """Two outputs that have each other's function are swapped, which says more than two wrong ones."""
    wrong = [f for f in findings if f.requirement.cause is Cause.STUCK and f.requirement.motor and f.wrong]
    if len(wrong) < 2 or {f.value for f in wrong} != {f.wanted for f in wrong}:
        return findings
    return [_swapped(f) if f in wrong else f for f in findings]


def _swapped(finding: Finding) -> Finding:
    requirement = dataclasses.replace(finding.requirement, cause=Cause.SWAPPED, fault="outputs are swapped")
    return dataclasses.replace(finding, requirement=requirement)
