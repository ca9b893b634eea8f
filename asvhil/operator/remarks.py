"""What operators are told of notes, as texts: what has become wrong, and what has recovered. Sans-IO."""

from __future__ import annotations

from asvhil.operator.reports import NOTICE, WARNING
from asvhil.supervisor import heading_cost, station_motion
from asvhil.types import Note

RECOVERED_NS = 3_000_000_000  # what is wrong again so soon has not recovered
RECOVERED = "recovered"
ENDED = "ended with the hold"
OVER = frozenset({RECOVERED, ENDED})  # the words that take a note away
# Which nobody has without a station.
OF_HOLD = frozenset({heading_cost.SUBJECT, station_motion.SUBJECT, station_motion.VELOCITY_SUBJECT})
AGAIN_NS = 60_000_000_000  # until it has, the same words are not told again so soon


class Remarks:
    """`step` in each tick with its notes. What comes and goes, as a receiver in multipath does, is told once."""

    def __init__(self) -> None:
        self._notes: tuple[Note, ...] = ()
        self._wrong: dict[str, dict[str, int]] = {}  # of each subject the texts that were told, and when
        self._well_ns: dict[str, int] = {}  # since when those of them have been well that are

    def step(self, t_ns: int, notes: tuple[Note, ...], *, held: bool = True) -> list[tuple[int, str]]:
        """The texts of this tick, each with its MAV_SEVERITY. `held`: whether a station is."""
        before, self._notes = self._notes, notes
        if notes == before and not self._well_ns:
            return []
        told = []
        for note in notes:
            if note.ok:
                continue
            self._well_ns.pop(note.subject, None)
            texts = self._wrong.setdefault(note.subject, {})
            if note not in before and t_ns - texts.get(note.text, -AGAIN_NS) >= AGAIN_NS:
                texts[note.text] = t_ns
                told.append((WARNING, f"{note.subject}: {note.text}"))
        wrong = {note.subject for note in notes if not note.ok}
        for subject in [subject for subject in self._wrong if subject not in wrong]:
            if t_ns - self._well_ns.setdefault(subject, t_ns) >= RECOVERED_NS:
                del self._wrong[subject], self._well_ns[subject]
                words = ENDED if subject in OF_HOLD and not held else RECOVERED
                told.append((NOTICE, f"{subject}: {words}"))
        return told
