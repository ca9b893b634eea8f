"""What operators are told of notes that come, go, change, and come again."""

from __future__ import annotations

from asvhil.operator.remarks import Remarks
from asvhil.types import Note

S = 1_000_000_000
JUMP, SILENT = (Note(subject="gnss position", text=text, ok=False) for text in ("jump rejected", "silent"))
WELL = Note(subject="outputs", text="follow the commands", ok=True)


class Told:
    def __init__(self) -> None:
        self.remarks, self.t_ns, self.texts = Remarks(), 1_700_000_000 * S, list[str]()

    def run(self, seconds: float, *notes: Note, held: bool = True) -> list[str]:
        found = []
        for _ in range(round(20 * seconds)):
            self.t_ns += S // 20
            found += [text for _, text in self.remarks.step(self.t_ns, notes, held=held)]
        self.texts += found
        return found


def test_what_is_wrong_is_told_at_once_and_recovers_after_a_while() -> None:
    told = Told()
    assert told.run(5.0, WELL) == []
    assert told.run(0.05, WELL, JUMP) == ["gnss position: jump rejected"]
    assert told.run(120.0, WELL, JUMP) == []
    assert told.run(2.9, WELL) == []
    assert told.run(0.2, WELL) == ["gnss position: recovered"]
    assert told.run(0.05, WELL, JUMP) == ["gnss position: jump rejected"]


def test_what_is_of_a_hold_ends_with_it_and_has_not_recovered() -> None:
    told, waits = Told(), Note(subject="moving station", text="waits, the boat is more than 3 m off", ok=False)
    told.run(1.0, JUMP, waits)
    assert told.run(4.0, held=False) == ["gnss position: recovered", "moving station: ended with the hold"]
    told.run(1.0, waits)
    assert told.run(4.0) == ["moving station: recovered"]


def test_what_comes_and_goes_is_told_once() -> None:
    """Three fixes of four are off by 20 m: 150 texts a minute at 5 Hz."""
    told = Told()
    for _ in range(75):
        told.run(0.6, JUMP)
        told.run(0.2)
    assert told.texts == ["gnss position: jump rejected"]
    told.run(4.0)
    assert told.texts[1:] == ["gnss position: recovered"]


def test_another_text_of_the_same_subject_is_told_at_once_and_not_again_and_again() -> None:
    told = Told()
    for _ in range(30):
        told.run(0.5, JUMP)
        told.run(0.5, SILENT)
    assert told.texts == ["gnss position: jump rejected", "gnss position: silent"]
    for _ in range(40):
        told.run(0.5, JUMP)
        told.run(0.5, SILENT)
    assert told.texts[2:] == ["gnss position: jump rejected", "gnss position: silent"], "a minute later"
