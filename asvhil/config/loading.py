"""YAML text to a validated, frozen config. Every error is one line that names the file and the key."""

from __future__ import annotations

import difflib
import json
import os
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from asvhil.config.plugins import PluginFile, load_files
from asvhil.config.root import Config
from asvhil.config.told import Lines, blamed, told
from asvhil.config.yaml_text import Path_, parse_yaml, read_yaml
from asvhil.errors import ConfigError
from asvhil.files import is_file

STORED = {"stored": True}
KNOWN_ONLY = {**STORED, "known_only": True}


def find_config(name: str) -> Path:
    """The path of a config file: as given, or a shipped one by its name. Raises ConfigError where there is neither."""
    return find_shipped(name, "", ".yaml", "config file")


def find_shipped(name: str, folder: str, ending: str, what: str, *, typed: bool = True) -> Path:
    """The path of a file: as given, or one shipped in config/`folder` by its name, with or without the ending.

    Raises ConfigError "NAME: no such WHAT" where there is neither, with the name that was meant, as far as a person has
    `typed` it.
    """
    given = Path(name)
    if is_file(given):
        return given
    for root in _shipped_roots():
        for candidate in (root / folder / name, root / folder / f"{name}{ending}"):
            if given.name == name and is_file(candidate):
                return candidate
    raise ConfigError(f"{name}: no such {what}{_meant(name, folder, ending) if typed else ''}")


def _meant(name: str, folder: str, ending: str) -> str:
    """ "; did you mean NAME?" of a file of one's own in this folder or a shipped one, or the shipped ones."""
    own, shipped = [path.name for path in Path().glob(f"*{ending}")], shipped_names(folder, ending)
    alike = difflib.get_close_matches(name, own + shipped, n=1)
    near = [f"{name}{ending}"] if f"{name}{ending}" in own else alike
    return f"; did you mean {near[0]}?" if near else f"; shipped ones are {', '.join(shipped)}"


def none_shipped(name: str, beside: Path) -> str:
    """What to tell of the base of a file that is neither beside it nor shipped, with the name that was meant."""
    own = [path.stem for path in beside.parent.glob("*.yaml") if path.name != beside.name]
    near = difflib.get_close_matches(name.removesuffix(".yaml"), own + shipped_names(), n=1)
    return f"and none shipped{f'; did you mean {near[0]}.yaml?' if near else ''}"


def _shipped_roots() -> tuple[Path, Path]:
    """Where shipped configs are: in an installed package, and in a checkout."""
    package = Path(__file__).resolve().parents[1]
    return package / "shipped_config", package.parent / "config"


def shipped_names(folder: str = "", ending: str = ".yaml") -> list[str]:
    """The names of the shipped configs, or of what else is shipped in config/`folder`."""
    return sorted({path.stem for root in _shipped_roots() for path in (root / folder).glob(f"*{ending}")})


def is_shipped(path: Path) -> bool:
    """Whether a config file is one of this program's own."""
    return path.resolve().parent in _shipped_roots()


def config_files(name: str) -> list[Path]:
    """The file of a config, and those below it by their `base:` keys. Raises ConfigError where one is missing."""
    files: list[Path] = []
    path: Path | None = find_config(name)
    while path is not None and path not in files:
        files.append(path)
        tree = read_yaml(path).tree
        path = base_of(path, tree) if isinstance(tree, dict) else None
    return files


def vehicle_name(path: Path) -> str | None:
    """`vehicle.name` of a config file, or of those below it; None where none has it. No plug-in is loaded."""
    vehicle = _read_tree(path, ())[0].get("vehicle")
    name = vehicle.get("name") if isinstance(vehicle, dict) else None
    return name if isinstance(name, str) else None


def load_config(path: str | Path, overrides: tuple[str, ...] = ()) -> Config:
    """Read a YAML config, merge it over the file its `base:` key names, apply `KEY=VALUE` overrides, validate.

    The plug-ins that it names are loaded, which runs their code.
    Raises ConfigError with one line that names the file and the key.
    """
    return load_with_places(path, overrides)[0]


def load_with_places(path: str | Path, overrides: tuple[str, ...] = ()) -> tuple[Config, Lines]:
    """As `load_config`, and where each key that is set is, by its path: "line 7", "line 3 of x.yaml", "--set K=V"."""
    found = find_config(str(path))
    tree, lines = _read_tree(found, ())
    for override in overrides:
        _apply_override(tree, lines, override)
    _load_plugins(tree, str(found), lines)
    try:
        return Config.model_validate(_sorted(tree)), lines
    except ValidationError as error:
        alone = _fault_alone(found, tree) if overrides else None
        raise told(error, str(found), lines, Config, alone) from None


def _fault_alone(path: Path, tree: dict[str, Any]) -> ValidationError | None:
    """What is wrong with a file without overrides, None if nothing; `tree` has the plug-ins that are loaded."""
    own, _ = _read_tree(path, ())
    plugins = {"plugins": tree["plugins"]} if "plugins" in tree else {}
    try:
        Config.model_validate(_sorted({**own, **plugins}))
    except ValidationError as error:
        return error
    return None


def config_from_json(text: str, source: str, *, known_only: bool = False) -> Config:
    """The config stored in a log, from its canonical JSON. Raises ConfigError naming the source.

    With `known_only`, keys of other versions that are unknown now are left out, and names of controllers and the like
    may be of plug-ins that are not here: enough to read the measurements, not to replay the run. No plug-in is loaded
    in either case.
    """
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{source}: the stored config is not JSON ({error})") from None
    return _validate(_known(tree), source, {}, KNOWN_ONLY) if known_only else _validate(tree, source, {}, STORED)


def overridden(config: Config, overrides: tuple[str, ...], option: str = "--set") -> Config:
    """A config with other values in some keys, given as KEY=VALUE. ConfigError names the option and the key."""
    tree = json.loads(config.canonical_json())
    lines: Lines = {}
    for override in overrides:
        _apply_override(tree, lines, override, option)
    return _validate(tree, option, lines, STORED)


def _known(tree: Any) -> Any:
    """A stored config without its unknown keys."""
    while True:  # the keys of a section may be told only after those above it
        try:
            Config.model_validate(tree, context=KNOWN_ONLY)
        except ValidationError as error:
            dropped = [_drop(tree, found["loc"]) for found in error.errors() if found["type"] == "extra_forbidden"]
            if any(dropped):
                continue
        return tree


def _drop(tree: Any, loc: tuple[int | str, ...]) -> bool:
    """Remove the key at `loc`, which may name a union's variant and then is no path in the tree: nothing is removed."""
    *parents, leaf = loc
    for part in parents:
        if not isinstance(tree, dict) or part not in tree:
            return False
        tree = tree[part]
    if not isinstance(tree, dict) or leaf not in tree:
        return False
    del tree[leaf]
    return True


def _read_tree(path: Path, seen: tuple[Path, ...]) -> tuple[dict[str, Any], Lines]:
    """The keys of a file over those of its base, and where each stands."""
    if path.resolve() in seen:
        raise ConfigError(f"{path}: key base: the chain of base files runs in a circle")
    found = read_yaml(path)
    tree = {} if found.tree is None else found.tree
    if not isinstance(tree, dict):
        raise ConfigError(f"{path}: a mapping of keys is expected at the top level, not {type(tree).__name__}")
    file = f" of {path.name}" if seen else ""
    lines = {place: f"line {line}{file}" for place, line in found.lines.items()}
    _place_plugins(tree, path.parent)
    _place_model(tree, path.parent)
    base_path = base_of(path, tree)
    tree.pop("base", None)
    if base_path is None:
        return tree, lines
    below, below_lines = _read_tree(base_path, (*seen, path.resolve()))
    return _merge(below, tree), below_lines | lines


def base_of(path: Path, tree: dict[str, Any]) -> Path | None:
    """The file that the `base:` key of a config names; None without one. ConfigError where there is no such file."""
    base = tree.get("base")
    if base is None:
        return None
    if not isinstance(base, str):
        raise ConfigError(f"{path}: key base: the name of a config file is expected, not {base!r}")
    beside = path.parent / base
    if is_file(beside):
        return beside
    try:  # a copy of a shipped config, without its base beside it
        return find_config(base)
    except ConfigError:
        words = f"no such file {base} beside it, {none_shipped(base, path)}"
        raise ConfigError(f"{path}: key base: {words}") from None


def _merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        if isinstance(value, dict) and isinstance(merged.get(key), dict):
            merged[key] = _merge(merged[key], value)
        else:
            merged[key] = value
    return merged


def override_value(override: str, option: str = "--set") -> tuple[str, Any]:
    """KEY=VALUE as the key and the value, which is YAML. ConfigError, with the option's name, for something else."""
    key, sign, text = (part.strip() for part in override.partition("="))
    if not sign or not all(key.split(".")):
        raise ConfigError(f"{option} {override}: KEY=VALUE is expected, such as controller.name=loiter")
    return key, parse_yaml(text, f"{option} {override}").tree


def _apply_override(tree: dict[str, Any], lines: dict[Path_, str], override: str, option: str = "--set") -> None:
    key, value = override_value(override, option)
    *parents, leaf = key.split(".")
    node = tree
    for name in parents:
        child = node.get(name)
        if child is None:
            child = node[name] = {}
        if not isinstance(child, dict):
            raise ConfigError(f"{option} {override}: {name} is a value, not a section")
        node = child
    node[leaf] = value
    path = tuple(key.split("."))
    for place in [place for place in lines if place[: len(path)] == path]:
        del lines[place]
    lines[path] = f"{option} {override}"


def _place_plugins(tree: dict[str, Any], folder: Path) -> None:
    """Paths of plug-ins made absolute; what is no list of files is told by the validation."""
    plugins = tree.get("plugins")
    if isinstance(plugins, list):
        files = [{"file": one} if isinstance(one, str) else one for one in plugins]
        tree["plugins"] = [
            {**one, "file": os.path.abspath(folder / Path(one["file"]).expanduser())}
            if isinstance(one, dict) and isinstance(one.get("file"), str)
            else one
            for one in files
        ]


def _place_model(tree: dict[str, Any], folder: Path) -> None:
    """The path of a model file that is beside the config and not in the working directory, so that it is found."""
    section = tree.get("controller")
    model = section.get("model") if isinstance(section, dict) else None
    if isinstance(model, str) and not is_file(Path(model)) and is_file(folder / model):
        tree["controller"] = {**section, "model": str(folder / model)}  # type: ignore[dict-item]


def _load_plugins(tree: dict[str, Any], source: str, lines: Lines) -> None:
    """Load the plug-ins of a config, and note the SHA-256 of each in it."""
    _place_plugins(tree, Path())  # those of an override; not by its name: the working directory may be gone
    if not tree.get("plugins"):
        return
    try:
        files = TypeAdapter(dict[str, tuple[PluginFile, ...]]).validate_python({"plugins": tree["plugins"]})
        plugins = load_files(files["plugins"])
    except ValidationError as error:
        raise told(error, source, lines) from None
    except ConfigError as error:
        raise ConfigError(f"{blamed(('plugins',), source, lines)}: key plugins: {error}") from None
    tree["plugins"] = [{"file": one.file, "sha256": one.sha256} for one in plugins]


def _validate(tree: Any, source: str, lines: Lines, context: Any = None) -> Config:
    try:
        return Config.model_validate(_sorted(tree), context=context)
    except ValidationError as error:
        raise told(error, source, lines, Config) from None


def _sorted(tree: Any) -> Any:
    """Mappings sorted by key, so that a config read back from a log gives bit-identical results."""
    if isinstance(tree, dict):
        return {key: _sorted(tree[key]) for key in sorted(tree, key=str)}
    return tree
