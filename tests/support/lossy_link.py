"""A boat whose autopilot is set right, at the end of a link that loses frames both ways, in virtual time."""

from __future__ import annotations

import random
from typing import cast

from asvhil.config import load_config
from asvhil.preflight.checks import checks_of
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import Check, Result
from asvhil.simplant.lockstep import EPOCH_NS
from asvhil.simplant.plant import Plant
from asvhil.supervisor.reasons import WORDS, Reason
from asvhil.types import Inputs, Outputs, Phase, record
from tests.support.loop import GroundStationLoop
from tests.support.lossy_plant import PlantBehindLink, losing
from tests.support.messages import messages, of_type

TICK_NS = 50_000_000
# What a parameter that is right must never be the cause of.
OF_PARAMETERS = frozenset(
    {
        Reason.AUTOPILOT_PARAMETER,
        Reason.OVERRIDES_IGNORED,
        Reason.COMMANDS_MIXED,
        Reason.OUTPUTS_SWAPPED,
        Reason.OUTPUT_REVERSED,
        Reason.OUTPUT_STUCK,
    }
)
OF_THE_LINK = ("rates",)  # sections of a check in which a loss is what is to be found
ASK_TICKS = 40  # a refused hold is asked for again


def behind_lossy_link(plant: Plant, loss: float, seed: int) -> Plant:
    """The plant, each frame of its autopilot's link lost with the same probability, either way."""
    way = losing(loss, random.Random(f"lossy link {seed}"))
    return cast(Plant, PlantBehindLink(plant, way, way))


@record
class CheckStart:
    """One `asvhil check`: what it found wrong though all is right, what it would write, and how long it took."""

    false: tuple[str, ...]
    fixable: tuple[str, ...]
    unverified: tuple[str, ...]
    seconds: float


@record
class HoldStart:
    """One start of the daemon and its first hold, asked for every 2 s from when the boat is armed.

    `refused`: why it was not granted at once; `granted_s` after the first request; `held_s` of it until `ended`, a
    reason, or the end of the trial (empty). `neutral_s`: how long it stood in fail-safe, neutral, of these.
    """

    refused: tuple[str, ...]
    granted_s: float | None
    held_s: float
    neutral_s: float
    fail_safes: int
    ended: str
    false: tuple[str, ...]

    @property
    def for_a_parameter(self) -> bool:
        """Whether a parameter, which is right, was taken for a cause."""
        return bool(self.false) or self.ended in OF_PARAMETERS or bool(OF_PARAMETERS.intersection(self.refused))


def check_start(loss: float, seed: int, config: str = "sitl") -> CheckStart:
    """A preflight, from its first tick to its end."""
    settings = load_config(config, (f"plant.seed={seed}",))
    plant, survey, t_ns = behind_lossy_link(Plant(settings, EPOCH_NS), loss, seed), Survey(settings), EPOCH_NS
    while survey.stage != "done":
        t_ns += TICK_NS
        for frame in survey.step(Inputs(t_ns=t_ns, frames=tuple(plant.advance(t_ns)))):
            plant.receive(frame)
    found = [check for check in checks_of(survey) if check.section not in OF_THE_LINK]
    return CheckStart(
        false=tuple(check.item for check in found if _is_false(check)),
        fixable=tuple(finding.name for finding in survey.fixable),
        unverified=tuple(check.item for check in found if check.result is Result.UNVERIFIED),
        seconds=(t_ns - EPOCH_NS) * 1e-9,
    )


def _is_false(check: Check) -> bool:
    return check.result in (Result.WARN, Result.FAIL)


def hold_start(
    loss: float, seed: int, hold_s: float = 60.0, config: str = "sitl", overrides: tuple[str, ...] = ()
) -> HoldStart:
    """Start the daemon, arm as soon as the vehicle can be armed, and a second later hold."""
    settings = ("supervisor.engage=command", f"plant.seed={seed}", *overrides)
    loop = GroundStationLoop(load_config(config, settings))
    loop.plant = behind_lossy_link(loop.plant, loss, seed)
    false: dict[str, None] = {}

    def note(outputs: Outputs) -> Outputs:
        false.update({n.text: None for n in outputs.health.notes if n.subject == "parameters"})
        return outputs

    def granted() -> bool:
        return bool(loop.results) and loop.results[-1] == 0

    for _ in range(140):
        note(loop.step())
    for _ in range(600):
        if loop.plant.frontseat.arm(True):
            break
        note(loop.step())
    for _ in range(20):  # a person looks before asking
        note(loop.step())
    mode = loop.config.supervisor.control_mode
    if mode == "OFFBOARD":
        for _ in range(40):
            loop.plant.frontseat.set_mode(6 << 16)
            note(loop.step())
    asked_ns, refused = loop.t_ns, []
    outputs = note(loop.ask_to_hold())
    while not granted() and loop.t_ns - asked_ns < 60_000_000_000:
        refused.append(_refusal(outputs))
        for _ in range(ASK_TICKS):
            note(loop.step())
        outputs = note(loop.ask_to_hold())
    granted_ns = loop.t_ns if granted() else None
    neutral, fail_safes, before, ended = 0, 0, Phase.HOLD, ""
    while granted_ns is not None and loop.t_ns - granted_ns < hold_s * 1e9:
        outputs = note(loop.step())
        neutral += outputs.phase is Phase.FAILSAFE
        fail_safes += outputs.phase is Phase.FAILSAFE and before is not Phase.FAILSAFE
        before = outputs.phase
        if outputs.phase is Phase.STANDBY:
            ended = outputs.health.code
            break
    return HoldStart(
        refused=tuple(refused),
        granted_s=None if granted_ns is None else (granted_ns - asked_ns) * 1e-9,
        held_s=0.0 if granted_ns is None else (loop.t_ns - granted_ns) * 1e-9,
        neutral_s=neutral * TICK_NS * 1e-9,
        fail_safes=fail_safes,
        ended=ended,
        false=tuple(false),
    )


def _refusal(outputs: Outputs) -> str:
    """The code of the reason, by its text to the operator."""
    texts = [message.text for message in of_type(messages(outputs.frames, "operator"), "STATUSTEXT")]
    for reason, words in WORDS.items():
        if any(words.text.split("{")[0] and text.startswith(words.text.split("{")[0]) for text in texts):
            return reason.value
    return "; ".join(texts)
