"""Which of the daemon's texts are notes, and which answer a request: both may read SUBJECT: TEXT. Sans-IO."""

from __future__ import annotations

import math
import re

from asvhil.supervisor.reasons import WORDS

FIRST = "mode: "  # begins what the daemon answers to the question of texts, but for its phase; the notes follow
GAP_S = 0.03  # between two texts of such an answer, which are of one tick
FIELD = re.compile(r"\{[^}]*\}")


class NoteSubjects:
    """Learns the subjects of notes from the answers to the question of them, which have nothing else.

    A warning with another subject is taken for the answer to a request, in the tick that has it.
    """

    def __init__(self) -> None:
        self._known: set[str] = set()
        self._listed_s = -math.inf  # when the last text was heard that was of such an answer

    def end_list(self) -> None:
        """Another message has come."""
        self._listed_s = -math.inf

    def hear(self, t_s: float, text: str | None) -> None:
        """Take in a text, or a piece of one (None)."""
        if text is not None and text.startswith(FIRST):
            self._listed_s = t_s
        elif t_s - self._listed_s <= GAP_S:
            self._listed_s = t_s
            if text is not None and ": " in text and not _HEADS.match(text):
                self._known.add(text.partition(": ")[0])

    def has(self, text: str) -> bool:
        """Whether a text is about one of them."""
        subject, separator, _ = text.partition(": ")
        return bool(separator) and subject in self._known


def _heads() -> re.Pattern[str]:
    """How the texts of reasons begin that have a colon of their own, such as "not armed: "."""
    texts = (words.text for words in WORDS.values() if ": " in words.text and not words.text.startswith("{"))
    heads = (FIELD.split(text.partition(": ")[0]) for text in texts)
    return re.compile("|".join(".+?".join(map(re.escape, parts)) + ": " for parts in heads))


_HEADS = _heads()
