"""A message is one line, whatever the names and values hold that it quotes."""

import pickle
from pathlib import Path

import pytest
from pydantic import BaseModel, model_serializer
from pydantic_core import PydanticSerializationError

from asvhil.config import load_config
from asvhil.errors import AsvhilError, ConfigError, LinkError, LogError, ModelError, OtherHullError, is_interrupt


@pytest.mark.parametrize("kind", [AsvhilError, ConfigError, LinkError, LogError, ModelError, OtherHullError])
@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a.yaml: no such file", "a.yaml: no such file"),
        ("x\ny", r"x\ny"),
        ("x\r\x1b[2Jy", r"x\r\x1b[2Jy"),
        ("x\u2028y\x85", r"x\u2028y\x85"),
        ("Fähre ⛵ 45°", "Fähre ⛵ 45°"),
        (r"C:\boats\n.yaml", r"C:\boats\n.yaml"),
    ],
)
def test_what_would_break_the_line_is_escaped(kind: type[AsvhilError], text: str, shown: str) -> None:
    error = kind(text)
    assert str(error) == shown
    assert str(pickle.loads(pickle.dumps(error))) == shown  # as from another process


@pytest.mark.parametrize(
    "text",
    [
        "base: |\n  sitl.yaml\n  - [0.0, 1.0]\n",
        'vehicle: {name: "a\\nb", vessel: {}}\n',
        'controller: {name: "pid\\nmpc"}\n',
        'controller: {model: "a\\nb.npz", name: nnsem-mpc}\n',
        '"supervisor\\nx": 1\n',
        'links: {autopilot: {endpoint: "udpin:\\n14550"}}\n',
        'plugins: ["a\\nb.py"]\n',
    ],
)
def test_a_config_with_breaks_in_its_values_is_refused_in_one_line(text: str, tmp_path: Path) -> None:
    file = tmp_path / "boat.yaml"
    file.write_text(text)
    with pytest.raises(AsvhilError) as caught:
        load_config(str(file))
    assert len(str(caught.value).splitlines()) == 1 and str(file) in str(caught.value)


def test_an_interrupt_is_known_whoever_hands_it_on() -> None:
    class Model(BaseModel):
        @model_serializer
        def interrupted(self) -> dict[str, int]:
            raise KeyboardInterrupt

    with pytest.raises(PydanticSerializationError) as wrapped:
        Model().model_dump()
    with pytest.raises(OSError) as cleared:
        try:
            raise KeyboardInterrupt
        finally:
            raise BrokenPipeError("the other end heard of it too")
    assert is_interrupt(KeyboardInterrupt()) and is_interrupt(wrapped.value) and is_interrupt(cleared.value)
    assert not is_interrupt(OSError("no such file")) and not is_interrupt(None)
