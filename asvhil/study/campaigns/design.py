"""The runs of a campaign: the points of its design, with every variant and seed, as overrides of a config."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import itertools
import json
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from asvhil.backseat.build import model_file
from asvhil.config.loading import load_config
from asvhil.config.root import Config
from asvhil.config.told import Lines
from asvhil.errors import AsvhilError, ConfigError
from asvhil.study.campaigns.shorthands import VESSEL, assignments, base_value, keys_of
from asvhil.study.campaigns.spec import CONFIG, OWN, CampaignSpec, ParameterSpec, wrong
from asvhil.study.made_of import run_files
from asvhil.study.runner import Job
from asvhil.study.trials.trial import run_key
from asvhil.types import record

NO_VARIANT = ""
# Overrides that can change which model file is used.
MODEL_KEYS = ("controller=", "controller.name=", "controller.model=", "controller.on_other_hull=", "vehicle")

_OVERRIDES = re.compile(r" \((?:line [^()]*; )?with --set .*")  # those that an error names at its end


@record
class PlannedRun:
    """One run: its place in the design, the values of the parameters, and what it is run with."""

    number: int
    point: int
    variant: str
    repeat: int
    seed: int
    values: dict[str, Any]
    base: str
    overrides: tuple[str, ...]


def points_of(spec: CampaignSpec) -> Iterator[dict[str, Any]]:
    """The values of the parameters at each point, in order. AsvhilError without SciPy, except for grids."""
    if spec.design.kind == "grid":
        levels = [parameter.levels() for parameter in spec.parameters.values()]
        for combination in itertools.product(*levels):
            yield dict(zip(spec.parameters, combination, strict=True))
        return
    try:
        from scipy.stats import qmc
    except ImportError:
        raise AsvhilError(f"design {spec.design.kind} needs SciPy: install asvhil[campaign]") from None
    count, d = spec.design.points or 0, len(spec.parameters)
    if spec.design.kind == "lhs":
        shares = qmc.LatinHypercube(d, rng=spec.design.seed).random(count)
    else:
        with warnings.catch_warnings():  # of numbers that are no power of two, which docs/campaigns.md tells
            warnings.simplefilter("ignore", UserWarning)
            shares = qmc.Sobol(d, scramble=True, rng=spec.design.seed).random(count)
    for row in shares.tolist():
        yield {name: p.at(share) for (name, p), share in zip(spec.parameters.items(), row, strict=True)}


def plan(spec: CampaignSpec) -> Iterator[PlannedRun]:
    """All runs in order: point by point, in each the variants, in each the repeats.

    The seed of a run depends on point and repeat, so that variants meet the same gusts and noise.
    """
    numbers = itertools.count()
    variants = spec.variants or {NO_VARIANT: {}}
    for point, values in enumerate(points_of(spec)):
        for variant, keys in variants.items():
            for repeat in range(spec.repeats):
                seed = spec.seed + point * spec.repeats + repeat
                base = str(values.get(CONFIG, spec.config))
                yield PlannedRun(
                    number=next(numbers),
                    point=point,
                    variant=variant,
                    repeat=repeat,
                    seed=seed,
                    values=values,
                    base=base,
                    overrides=_overrides(spec, base, values, {**spec.set, **keys, "plant.seed": seed}),
                )


def job_of(run: PlannedRun, window_s: tuple[float, float]) -> Job:
    """The run for `runner.run_jobs`. The key tells the config by the base, the overrides and the model file.

    It does not read the config of each run, so that a million keys take seconds.
    """
    text = json.dumps(run.overrides)
    digest = hashlib.sha256(f"{_base_hash(run.base)} {text}".encode()).hexdigest()[:24]
    model = _model(run.base, tuple(one for one in run.overrides if one.startswith(MODEL_KEYS)))
    key = f"campaign {digest} {model} {window_s[0]:g}-{window_s[1]:g}"
    return Job(key=key, group=run.variant or "runs", arguments=(run.base, run.overrides, window_s))


def files_of(spec: CampaignSpec) -> list[Path]:
    """The configs, plug-ins and model files behind the runs, each once; nothing of a run that cannot be.

    Only parameters that can change them are gone through: a design may have millions of points.
    """
    first = next(points_of(spec))
    decisive = {name: p.ends() for name, p in spec.parameters.items() if name == CONFIG or _chooses(_keys(name, p))}
    choices = set()
    for values in itertools.product(*decisive.values()):
        for keys in (spec.variants or {NO_VARIANT: {}}).values():
            point = first | dict(zip(decisive, values, strict=True))
            base = str(point.get(CONFIG, spec.config))
            with contextlib.suppress(AsvhilError):
                overrides = _overrides(spec, base, point, {**spec.set, **keys})
                choices.add((base, tuple(one for one in overrides if one.startswith(MODEL_KEYS))))
    found: set[Path] = set()
    for base, keys_of_model in choices:
        with contextlib.suppress(AsvhilError):
            found.update(run_files(base, keys_of_model))
    return sorted(found)


def _chooses(keys: Sequence[str]) -> bool:
    """Whether one of the keys can change which model file is used."""
    return any(f"{key}=".startswith(MODEL_KEYS) for key in keys)


def check(spec: CampaignSpec, path: Path, lines: Lines) -> None:
    """ConfigError, one line, for a key that is none, a value that cannot be, or a key that is set twice.

    Each value of a parameter and both ends of a range are tried in the first point, with the first variant.
    """
    _check_keys(spec, path, lines)
    bases: list[tuple[tuple[str, ...], str]] = [(("config",), spec.config)]
    if CONFIG in spec.parameters:
        bases = [(("parameters", CONFIG), str(one)) for one in spec.parameters[CONFIG].levels()]
    for place, base in bases:
        try:
            _config(base)
        except AsvhilError as error:
            raise wrong(path, lines, place, str(error)) from None
    first = next(points_of(spec))
    variants = spec.variants or {NO_VARIANT: {}}
    for variant, keys in variants.items():
        if _fault(spec, first, {**spec.set, **keys}):
            raise _blamed(spec, first, variant, path, lines)
    keys = next(iter(variants.values()))
    for name, parameter in spec.parameters.items():
        for value in parameter.ends():
            fault = _fault(spec, {**first, name: value}, {**spec.set, **keys})
            if fault:
                raise wrong(path, lines, ("parameters", name), fault)


def _blamed(spec: CampaignSpec, first: Mapping[str, Any], variant: str, path: Path, lines: Lines) -> ConfigError:
    """What is wrong with the first point: keys of all runs, the first parameter that cannot be, or a variant."""
    values = {name: value for name, value in first.items() if name == CONFIG}
    fault = _fault(spec, values, spec.set)
    place: tuple[str, ...] = ("config",) if fault == _fault(spec, values, {}) else ("set",)
    for name in first:
        if fault:
            break
        values[name] = first[name]
        place, fault = ("parameters", name), _fault(spec, values, spec.set)
    if not fault:
        place = ("variants", variant)
        fault = _fault(spec, values, {**spec.set, **spec.variants[variant]})
    return wrong(path, lines, place, fault)


def _check_keys(spec: CampaignSpec, path: Path, lines: Lines) -> None:
    owners: dict[str, str] = {}
    places: list[tuple[tuple[str, ...], list[str]]] = [(("set",), list(spec.set))]
    places += [(("parameters", name), _keys(name, parameter)) for name, parameter in spec.parameters.items()]
    for place, keys in places:
        for key in keys:
            _check_key(key, place, owners, path, lines)
        owners |= dict.fromkeys(keys, ".".join(place))
    for variant, own in spec.variants.items():
        for key in own:
            _check_key(key, ("variants", variant), owners, path, lines)
    sets: list[tuple[tuple[str, ...], Mapping[str, Any]]] = [(("set",), spec.set)]
    sets += [(("variants", variant), own) for variant, own in spec.variants.items()]
    for name, parameter in spec.parameters.items():
        if isinstance(parameter.values, dict):
            sets += [(("parameters", name), own) for own in parameter.values.values()]
    for place, one in sets:
        for key in one:
            _check_key(key, place, {other: "the same set" for other in one if other != key}, path, lines)


def _check_key(key: str, place: tuple[str, ...], owners: Mapping[str, str], path: Path, lines: Lines) -> None:
    """ConfigError for a key that the campaign sets itself, or that another place sets: it, its section, or a part."""
    for own, why in OWN.items():
        if _overlap(key, own):
            raise wrong(path, lines, place, f"{key} cannot be set here: {why}")
    for other, owner in owners.items():
        if _overlap(key, other):
            what = key if key == other else f"{key} with {other}"
            raise wrong(path, lines, place, f"{what} is set by {owner} too")


def _overlap(one: str, other: str) -> bool:
    """Whether two keys are the same, or one is a section that has the other in it."""
    return f"{one}.".startswith(f"{other}.") or f"{other}.".startswith(f"{one}.")


def _keys(name: str, parameter: ParameterSpec) -> list[str]:
    if isinstance(parameter.values, dict):
        return list(dict.fromkeys(key for keys in parameter.values.values() for key in keys))
    return list(keys_of(name))


def _fault(spec: CampaignSpec, values: Mapping[str, Any], keys: Mapping[str, Any]) -> str:
    """What is wrong with a config, in words; empty where it can be run."""
    try:
        base = str(values.get(CONFIG, spec.config))
        config = load_config(base, _overrides(spec, base, values, keys))
        config.check_faults()
        model_file(config)
    except AsvhilError as error:
        return _words(str(error))
    if config.supervisor.station is None:
        return "supervisor.station: a campaign needs a station to keep"
    for fault in config.plant.faults:
        if fault.from_s >= spec.window_s[1]:
            return (
                f"plant.faults: {fault.kind} begins at {fault.from_s:g} s, and the runs end at {spec.window_s[1]:g} s"
            )
    return ""


def _words(error: str) -> str:
    """An error of a config without the file and the override, which the reader of a campaign never wrote."""
    text = error.partition(": key ")[2] or error.removeprefix("--fault ")
    return _OVERRIDES.sub("", text)


def _overrides(spec: CampaignSpec, base: str, values: Mapping[str, Any], fixed: Mapping[str, Any]) -> tuple[str, ...]:
    """KEY=VALUE of one run. Keys of the simulated hull make a whole one, by that of the config."""
    config = _config(base)
    found = dict(fixed)
    for name, value in values.items():
        parameter = spec.parameters[name]
        if name == CONFIG:
            continue
        if isinstance(parameter.values, dict):
            found |= parameter.values[value]
            continue
        if parameter.factor:
            key = keys_of(name)[0]
            own = base_value(config, key)
            if isinstance(own, bool) or not isinstance(own, int | float):
                raise ConfigError(f"{key}: a factor needs a number in the config, and {base} has {own!r}")
            value = float(f"{own * value:.{parameter.digits}g}")
        found |= assignments(name, value)
    hull = {key: found.pop(key) for key in list(found) if key.startswith(f"{VESSEL}.")}
    if hull:
        whole = config.plant_vessel.model_dump(mode="json")
        found[VESSEL] = whole | {key.removeprefix(f"{VESSEL}."): value for key, value in hull.items()}
    return tuple(f"{key}={json.dumps(value)}" for key, value in found.items())


@functools.cache
def _config(base: str) -> Config:
    return load_config(base)


@functools.cache
def _base_hash(base: str) -> str:
    return run_key(_config(base))


@functools.cache
def _model(base: str, overrides: Sequence[str]) -> str:
    """What tells the model file that a controller predicts with; empty where the config is wrong: the run will tell."""
    try:
        return run_key(load_config(base, tuple(overrides))).partition(" ")[2]
    except AsvhilError:
        return ""
