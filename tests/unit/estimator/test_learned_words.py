"""What is learned in words, and the note of a weak motor, which comes and goes with some slack."""

from asvhil.estimator.learned_words import RAN_OFF, LearningNotes, learned_text
from asvhil.types import Learned, changed


def learned(*factors: float, std: float = 0.02, learned_s: float = 60.0) -> Learned:
    return Learned(factors=factors, std=(std,) * 5, learned_s=learned_s)


def test_only_what_is_known_and_differs_is_told() -> None:
    assert learned_text(learned(1.0, 1.04, 1.0, 0.97, 1.0)) == "the boat answers as the model says"
    assert learned_text(learned(0.713, 1.0, 1.0, 1.0, 1.082)) == (
        "port motor gives 71 % of the model's thrust, yaw answers by 108 %"
    )
    assert learned_text(learned(0.713, 0.7, 1.0, 1.0, 1.0), 5.0) == (
        "port motor gives 70 % of the model's thrust, starboard motor gives 70 %"
    )
    assert learned_text(learned(0.713, 1.0, 1.0, 1.0, 1.0, std=0.1)) == "not known yet"


def test_that_it_was_stopped_is_told_whatever_was_known() -> None:
    notes = LearningNotes()
    notes.step(learned(0.6, 1.0, 1.0, 1.0, 1.0))
    (note,) = notes.step(changed(learned(1.0, 1.0, 1.0, 1.0, 1.0, learned_s=0.0), frozen=RAN_OFF))
    assert not note.ok and "is the compass right" in note.text.lower()


def test_nothing_is_told_before_anything_is_learned() -> None:
    assert LearningNotes().step(learned(0.7, 1.0, 1.0, 1.0, 1.0, learned_s=0.0)) == ()


def test_a_weak_motor_is_told_until_it_is_sound_again() -> None:
    notes = LearningNotes()
    assert [note.subject for note in notes.step(learned(0.78, 1.0, 1.0, 1.0, 1.0))] == ["learning"]
    told, weak = notes.step(learned(0.71, 1.0, 1.0, 1.0, 1.0))
    assert told.ok and told.text == "port motor gives 70 % of the model's thrust"
    assert not weak.ok and weak.text == "port motor gives 71 % of the model's thrust: weed, a line, a worn propeller?"
    assert notes.step(learned(0.72, 1.0, 1.0, 1.0, 1.0)) == (told, weak)  # not each per cent is news
    assert len(notes.step(learned(0.82, 1.0, 1.0, 1.0, 1.0))) == 2
    assert len(notes.step(learned(0.86, 1.0, 1.0, 1.0, 1.0))) == 1
    assert len(notes.step(learned(0.82, 1.0, 1.0, 1.0, 1.0))) == 1


def test_both_motors_alike_are_weak_for_another_reason() -> None:
    *_, weak = LearningNotes().step(learned(0.72, 0.68, 1.0, 1.0, 1.0))
    assert weak.text == "both motors give 70 % of the model's thrust: low battery, worn propellers?"
    *_, weak = LearningNotes().step(learned(0.72, 0.55, 1.0, 1.0, 1.0))
    assert weak.text.startswith("starboard motor gives 55 %")
