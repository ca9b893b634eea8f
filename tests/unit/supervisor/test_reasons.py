"""The table of reasons: a text and a remedy for each, and details that fit wherever a reason is given."""

import ast

from asvhil.supervisor.reasons import WORDS, Explanation, Reason, describe, explain, fields_of, remedy
from tests.support.paths import ROOT


def explained_in_the_package() -> list[tuple[str, Reason, frozenset[str]]]:
    """(file and line, reason, names of its details) of every `explain(Reason.X, ...)` in the package."""
    found = []
    for path in sorted((ROOT / "asvhil").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "explain"):
                continue
            reason = node.args[0]
            if isinstance(reason, ast.Attribute):
                names = frozenset(keyword.arg for keyword in node.keywords if keyword.arg)
                found.append((f"{path.relative_to(ROOT)}:{node.lineno}", Reason[reason.attr], names))
    return found


def test_every_reason_has_a_text_and_a_remedy_and_no_two_have_the_same() -> None:
    assert set(WORDS) == set(Reason)
    assert all(words.text and words.remedy.endswith(".") for words in WORDS.values())
    assert len({words.text for words in WORDS.values()}) == len(WORDS)
    assert all(words.text.isascii() for words in WORDS.values())  # a STATUSTEXT


def test_the_details_that_are_given_are_those_of_the_text() -> None:
    calls = explained_in_the_package()
    assert len(calls) > 30
    wrong = [(place, reason) for place, reason, names in calls if names - {"hint"} != fields_of(reason)]
    assert wrong == []


def test_every_reason_is_given_somewhere() -> None:
    sources = [path.read_text() for path in (ROOT / "asvhil").rglob("*.py") if path.name != "reasons.py"]
    assert [reason.name for reason in Reason if not any(f"Reason.{reason.name}" in text for text in sources)] == []


def test_details_and_a_hint_go_into_the_text() -> None:
    assert describe(explain(Reason.STICK_MOVED, channel=4)) == "stick of channel 4 moved"
    assert describe(explain(Reason.COMMANDS_MIXED, hint="PILOT_STEER_TYPE")) == "commands are mixed (PILOT_STEER_TYPE)"
    assert describe(explain(Reason.COMMANDS_MIXED, hint="")) == "commands are mixed"


def test_explanations_compare_by_reason_and_details_whatever_their_order() -> None:
    one = explain(Reason.WRONG_MODE, mode="HOLD", needed="MANUAL")
    assert one == explain(Reason.WRONG_MODE, needed="MANUAL", mode="HOLD") and one != explain(Reason.WRONG_MODE)
    assert one == Explanation(reason=Reason.WRONG_MODE, detail=(("mode", "HOLD"), ("needed", "MANUAL")))


def test_a_code_of_another_version_has_no_remedy() -> None:
    assert remedy(Reason.NOT_ARMED.value) == WORDS[Reason.NOT_ARMED].remedy
    assert remedy("") == remedy("made-up") == ""
