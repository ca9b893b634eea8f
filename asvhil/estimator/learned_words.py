"""What is learned of the model in words, for people, and the note of a motor that gives too little."""

from __future__ import annotations

from asvhil.dynamics.corrected import FACTORS
from asvhil.types import Learned, Note

SUBJECT, MOTOR_SUBJECT = "learning", "motor thrust"
RAN_OFF = "stopped: no motors answer as these seem to. Is the compass right?"
HELD_STD = 9.0  # of factors that stand for nothing, however sure the filter is
HELD_BACK = "held back: in a current thrust and response cannot be told apart"
KNOWN_STD = 0.08  # a factor that is known worse is not told
SHOWN = 0.05  # of a factor's difference from 1, and of the steps in which notes tell it
WEAK, SOUND = 0.8, 0.85  # a motor is told as weak below the first, for sure, and no longer above the second
SURE_STDS = 2.0
ALIKE = 0.1  # motors that differ by less are weak for one reason


def known(learned: Learned) -> tuple[bool, ...]:
    """Of each factor whether it is known well enough to be told, and to begin with another time."""
    return tuple(std <= KNOWN_STD for std in learned.std)


def is_held_back(learned: Learned) -> bool:
    """Whether the factors are not to be told, kept or taken."""
    return min(learned.std) >= HELD_STD


def learned_text(learned: Learned, percent: float = 1.0) -> str:
    """Such as "port motor gives 71 % of the model's thrust, yaw answers by 108 %", rounded to so many per cent."""
    if is_held_back(learned):
        return HELD_BACK
    told: list[str] = []
    for name, factor, is_known in zip(FACTORS, learned.factors, known(learned), strict=True):
        if not is_known or abs(factor - 1.0) < SHOWN:
            continue
        share = f"{percent * round(100.0 * factor / percent):.0f} %"
        if name in ("port", "starboard"):
            told.append(f"{name} motor gives {share}" + ("" if told else " of the model's thrust"))
        else:
            told.append(f"{name} answers by {share}")
    if not told and max(learned.std[:2]) > KNOWN_STD:
        return "not known yet"
    return ", ".join(told) or "the boat answers as the model says"


class LearningNotes:
    """`step` in each tick: the notes, whose text changes only with what it tells."""

    def __init__(self) -> None:
        self._told: Learned | None = None
        self._weak: tuple[str, ...] = ()

    def step(self, learned: Learned) -> tuple[Note, ...]:
        """What is learned, and whether a motor is weak."""
        if learned.frozen == RAN_OFF:
            self._told, self._weak = None, ()
            return (Note(subject=SUBJECT, text=RAN_OFF, ok=False),)
        if not learned.learned_s:
            return ()
        told = self._told
        if told is None or _tells_more(learned, told):
            self._told = told = learned
        note = Note(subject=SUBJECT, text=learned_text(told, 100.0 * SHOWN), ok=True)
        weak = self._weak_motors(learned)
        if weak != self._weak:
            self._weak, self._told = weak, learned
            note = Note(subject=SUBJECT, text=learned_text(learned, 100.0 * SHOWN), ok=True)
        return (note,) if not weak else (note, Note(subject=MOTOR_SUBJECT, text=_weak_text(weak, self._told), ok=False))

    def _weak_motors(self, learned: Learned) -> tuple[str, ...]:
        """The names of those that give too little."""
        found = []
        for name, factor, std in zip(FACTORS[:2], learned.factors, learned.std, strict=False):
            if is_held_back(learned):
                continue
            limit = SOUND if name in self._weak else WEAK - SURE_STDS * std
            if factor < limit:
                found.append(name)
        return tuple(found)


def _tells_more(learned: Learned, told: Learned) -> bool:
    """Whether a factor is another one than was told, or has become known."""
    pairs = zip(learned.factors, told.factors, strict=True)
    if is_held_back(learned) or is_held_back(told):
        return is_held_back(learned) != is_held_back(told)
    if max(abs(factor - before) for factor, before in pairs) > SHOWN:
        return True
    return any(std <= KNOWN_STD < before for std, before in zip(learned.std, told.std, strict=True))


def _weak_text(weak: tuple[str, ...], told: Learned | None) -> str:
    assert told is not None
    shares = dict(zip(FACTORS, told.factors, strict=True))
    if len(weak) == 2 and abs(shares["port"] - shares["starboard"]) < ALIKE:
        share = 50.0 * (shares["port"] + shares["starboard"])
        return f"both motors give {share:.0f} % of the model's thrust: low battery, worn propellers?"
    worst = min(weak, key=lambda name: shares[name])
    return f"{worst} motor gives {100.0 * shares[worst]:.0f} % of the model's thrust: weed, a line, a worn propeller?"
