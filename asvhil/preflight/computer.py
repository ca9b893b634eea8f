"""The checks that need no vehicle: the controller's model, and room for the log."""

from __future__ import annotations

import shutil
from pathlib import Path

from asvhil.backseat.build import build_model, model_file, model_replaced
from asvhil.config import Config
from asvhil.dynamics.hull import hull_text
from asvhil.dynamics.weights import read_model
from asvhil.errors import AsvhilError, ConfigError
from asvhil.logs.learned_file import offer
from asvhil.preflight.table import Check, Result

LOG_MB_PER_HOUR = 150.0  # twice what a run with the default streams leaves
OWN_HULL = "`asvhil init` writes a config of your own boat; if this is yours, give its own vehicle.vessel.mass_kg"
FAIL_HOURS, WARN_HOURS = 1.0, 8.0


def computer_checks(config: Config, borrowed: str = "") -> list[Check]:
    """Of this computer. `borrowed`: the shipped file that the hull is from (`config.borrowed`)."""
    return [*boat_checks(config, borrowed), *_learned(config), _log_space(config)]


def boat_checks(config: Config, borrowed: str = "") -> list[Check]:
    """Whose hull and whose model are in use."""
    return [_model(config), _hull(config, borrowed)]


def simulation_checks(config: Config) -> list[Check]:
    """A warning where the simulated boat of a config could not be built, as `asvhil run` needs none."""
    try:
        config.check_faults()
    except ConfigError as error:
        wanted, todo = "faults of devices that it has", "no simulation starts with these; `asvhil run` does"
        row = Check(
            section="computer", item="simulated boat", result=Result.WARN, found=str(error), wanted=wanted, todo=todo
        )
        return [row]
    return []


def _hull(config: Config, borrowed: str) -> Check:
    """The hull in figures that its owner knows; a warning where it is a shipped boat's in somebody else's config."""
    found = f"{config.vehicle.name}: {hull_text(config.vehicle.vessel)}"
    if not borrowed:
        return Check(section="computer", item="hull", result=Result.PASS, found=found)
    return Check(
        section="computer",
        item="hull",
        result=Result.WARN,
        found=f"{found}: that of the shipped {borrowed}",
        wanted="that of your boat",
        todo=OWN_HULL,
    )


def _model(config: Config) -> Check:
    """Whether the model loads, is of the kind that the controller needs, of this vehicle, and of this step."""
    name = config.vehicle.name
    wanted = f"of {name}"
    try:
        file = model_file(config)
        model = build_model(config, file)
    except AsvhilError as error:
        todo = "train one (docs/models.md), or set controller.model"
        return Check(section="computer", item="model", result=Result.FAIL, found=str(error), wanted=wanted, todo=todo)
    found = f"physics of {name}" if file is None else f"{file.name}, {model.name} of {name}"
    if model_replaced(config, model) and file is not None:
        found = f"{file.name} is of another hull, so the physics of {name} stand in for it"
        todo = "train a model on this boat (docs/models.md)"
        return Check(section="computer", item="model", result=Result.WARN, found=found, wanted=wanted, todo=todo)
    if file is not None and not read_model(file).hull:
        found += "; the file does not tell of which hull"
    return Check(section="computer", item="model", result=Result.PASS, found=found, wanted=wanted)


def _learned(config: Config) -> list[Check]:
    """What an earlier run has learned of the model, where it has left something that is not in use."""
    offered = offer(config)
    if offered is None:
        return []
    todo = "" if offered.usable else "remove the file, or learn anew"
    result = Result.PASS if offered.usable else Result.WARN
    return [Check(section="computer", item="learned on station", result=result, found=offered.text, todo=todo)]


def _log_space(config: Config) -> Check:
    """Free space where logs go, in hours of logging."""
    folder = Path(config.recorder.directory).expanduser()
    there = next((path for path in (folder, *folder.resolve().parents) if path.is_dir()), Path("/"))
    hours = shutil.disk_usage(there).free / 1e6 / LOG_MB_PER_HOUR
    result = Result.FAIL if hours < FAIL_HOURS else Result.WARN if hours < WARN_HOURS else Result.PASS
    return Check(
        section="computer",
        item="log space",
        result=result,
        found=f"{hours * LOG_MB_PER_HOUR / 1000.0:.1f} GB in {folder}, {hours:.0f} h",
        wanted=f"{WARN_HOURS:g} h",
        todo="" if result is Result.PASS else "make room, or set recorder.directory",
    )
