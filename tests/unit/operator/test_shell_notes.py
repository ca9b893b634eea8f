"""Notes of the shell on their way into the core."""

import pytest

from asvhil.backseat.build import build_backseat
from asvhil.config import load_config
from asvhil.daemon.own_notes import OwnNotes
from asvhil.io.mavlink.frames import FrameSplitter, decode
from asvhil.operator.shell_notes import MOST, NoteReader, NoteSender
from asvhil.types import Frame, Inputs, Note
from tests.support.messages import messages

CONFIG = load_config("sitl")


def tell(reader: NoteReader, sender: NoteSender, subject: str, text: str, *, ok: bool = False) -> None:
    for data in FrameSplitter().receive(sender.encode(Note(subject=subject, text=text, ok=ok))):
        reader.receive(decode(data))


@pytest.mark.parametrize("text", ["x", "y" * 42, "z" * 43, "it: has a colon", "recording stopped: " + "w" * 300])
def test_a_note_stands_until_it_is_taken_back(text: str) -> None:
    reader, sender = NoteReader(), NoteSender(CONFIG.links.autopilot)
    tell(reader, sender, "display", "something else")
    tell(reader, sender, "log", text)
    tell(reader, sender, "display", "well again", ok=True)
    assert reader.notes == (
        Note(subject="display", text="well again", ok=True),
        Note(subject="log", text=text, ok=False),
    )
    tell(reader, sender, "display", "")
    assert reader.notes == (Note(subject="log", text=text, ok=False),)
    tell(reader, sender, "log", "")
    assert reader.notes == ()


def test_subjects_are_bounded() -> None:
    reader, sender = NoteReader(), NoteSender(CONFIG.links.autopilot)
    for number in range(MOST + 5):
        tell(reader, sender, f"subject {number}", "x")
    tell(reader, sender, "subject 0", "y")
    assert len(reader.notes) == MOST and reader.notes[0].text == "y"


def test_what_changes_is_told_once_and_the_operator_hears_of_it() -> None:
    wrong = {"log": "", "display": ""}
    own = OwnNotes(CONFIG.links.autopilot, {name: lambda name=name: wrong[name] for name in wrong})  # type: ignore[misc]
    backseat = build_backseat(CONFIG)
    t_ns, heard = 10**18, []

    def tick() -> tuple[Note, ...]:
        nonlocal t_ns
        t_ns += 50_000_000
        beat = bytes.fromhex("fd09000000ffbe0000000000000006080000039ae5")
        frames = (Frame(t_ns=t_ns, port="operator", data=beat, peer="10.0.0.9:14550"), *own.take_frames(t_ns))
        outputs = backseat.step(Inputs(t_ns=t_ns, frames=frames))
        texts = [m.text for m in messages(outputs.frames, "operator") if m.get_type() == "STATUSTEXT"]
        heard.append(["".join(texts)] if texts else [])
        return tuple(note for note in outputs.health.notes if note.subject in (*wrong, "terminal"))

    assert tick() == ()
    wrong["log"] = "recording stopped: No space left on device"
    stopped = Note(subject="log", text=wrong["log"], ok=False)
    assert tick() == (stopped,) and tick() == (stopped,)
    own.note("terminal", "hung up: the run goes on without it")
    assert [note.subject for note in tick()] == ["log", "terminal"]
    wrong["log"] = ""
    assert [note.subject for note in tick()] == ["terminal"]
    for _ in range(60):  # a recovery is told once it has lasted
        tick()
    heard[5:] = [texts for texts in heard[5:] if "log: recovered" in texts]
    assert heard[1:] == [
        ["log: recording stopped: No space left on device"],
        [],
        ["terminal: hung up: the run goes on without it"],
        [],
        ["log: recovered"],
    ]


def test_a_stranger_cannot_put_notes_in() -> None:
    backseat, t_ns = build_backseat(CONFIG), 10**18
    data = NoteSender(CONFIG.links.autopilot).encode(Note(subject="log", text="all lost", ok=False))
    frame = Frame(t_ns=t_ns, port="operator", data=data, peer="10.0.0.9:14550")
    assert "log" not in [n.subject for n in backseat.step(Inputs(t_ns=t_ns, frames=(frame,))).health.notes]
