"""How the boat's motors were found to be wired: as lines of the table, and as the keys that hold a boat to it."""

from __future__ import annotations

from asvhil.autopilot.requirements import Finding
from asvhil.autopilot.wiring import MotorWiring
from asvhil.config import MotorOutputConfig
from asvhil.preflight.survey import Survey

SIDES = ("port", "starboard")


def found_keys(survey: Survey) -> dict[str, dict[str, int]]:
    """`vehicle.pwm.port` and `.starboard` as they would be set for this boat."""
    return {side: _keys(wired) for side, wired in zip(SIDES, survey.link.wiring.motors, strict=True)}


def motor_text(survey: Survey, side: int) -> str:
    """One motor (0: port, 1: starboard) in a line."""
    wiring = survey.link.wiring
    wired = wiring.motors[side]
    motor = wired.motor
    sense = ", reversed" if motor.reversed else ""
    pulses = f"astern {motor.astern_us:g}, neutral {motor.neutral_us:g}, ahead {motor.ahead_us:g} us"
    stick = f"; stick channel {wiring.channels[side]}" if survey.config.links.autopilot.overrides_sticks else ""
    return f"output {wired.output}{sense}: {pulses}{stick}"


def doubts_of_wiring(survey: Survey, side: int) -> list[Finding]:
    """What speaks against the wiring that was found of a motor (0: port, 1: starboard), or has not answered."""
    return [
        finding
        for finding in survey.findings
        if finding.requirement.wiring and not finding.ok and finding.requirement.motor in ("", SIDES[side])
    ]


def yaml_to_pin(survey: Survey) -> str:
    """The lines of YAML that hold this boat to the wiring that was found.

    Empty where the config has them already, and where it is not certain that this is how the boat is wired.
    """
    pwm, found = survey.config.vehicle.pwm, found_keys(survey)
    doubtful = survey.stranger is not None or any(doubts_of_wiring(survey, side) for side in range(len(SIDES)))
    if doubtful or survey.link.unread_wiring or all(_is_pinned(config) for config in (pwm.port, pwm.starboard)):
        return ""
    rows = (
        f"    {side}: {{{', '.join(f'{key}: {value}' for key, value in keys.items())}}}\n"
        for side, keys in found.items()
    )
    return "vehicle:\n  pwm:\n" + "".join(rows)


def _keys(wired: MotorWiring) -> dict[str, int]:
    motor = wired.motor
    return {
        "output": wired.output,
        "astern_us": round(motor.astern_us),
        "neutral_us": round(motor.neutral_us),
        "ahead_us": round(motor.ahead_us),
    }


def _is_pinned(config: MotorOutputConfig) -> bool:
    return None not in (config.output, config.neutral_us, config.ahead_us)
