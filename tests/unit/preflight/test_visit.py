"""What is said of an autopilot's line that does not open."""

import asyncio
import time

import pytest

from asvhil.config import load_config
from asvhil.errors import LinkError
from asvhil.links.endpoint import open_endpoint
from asvhil.preflight.runner import Preflight
from asvhil.preflight.script_tool import ScriptTool
from asvhil.preflight.visit import in_brackets, unopened_text

MISSING = "serial:/dev/no-such-port:115200"


async def state_of(spec: str) -> str:
    with pytest.raises(LinkError) as caught:
        await open_endpoint(spec, "autopilot", time.monotonic_ns)
    return str(caught.value)


async def state_of_taken() -> str:
    holder = await open_endpoint("udpin:127.0.0.1:0", "holder", time.monotonic_ns)
    try:
        return await state_of(f"udpin:{holder.address}")
    finally:
        await holder.close()


@pytest.mark.real_time
def test_the_daemon_is_asked_about_where_the_port_is_taken() -> None:
    said = unopened_text(asyncio.run(state_of_taken()))
    assert said.endswith("another program has this port; is `asvhil run` using it? (links.autopilot.endpoint)")


@pytest.mark.real_time
@pytest.mark.parametrize("command", ["check", "script"])
def test_a_port_that_is_not_there_is_said_to_be_that(command: str) -> None:
    config = load_config("field", (f"links.autopilot.endpoint={MISSING}",))
    visit = Preflight(config, 5.0).run() if command == "check" else ScriptTool(config, 5.0, lambda *_: None).status("")
    with pytest.raises(LinkError) as caught:
        asyncio.run(visit)
    assert str(caught.value) == (
        f"{MISSING}: no such file or directory: is it plugged in, is the path right? (links.autopilot.endpoint)"
    )


def test_what_was_dropped_stands_behind_the_question() -> None:
    assert in_brackets("3 unsigned frames dropped") == " (3 unsigned frames dropped)"
    assert in_brackets("") == ""
