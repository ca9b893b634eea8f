"""`asvhil config`: what a config is, whether it is right, what its keys do, and its schema for editors."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from asvhil.commands.options import ConfigArgument, SetOption, json_option
from asvhil.commands.outputs import check_figures, check_json, config_and_bases, write_json, writing
from asvhil.commands.views import say
from asvhil.errors import ConfigError
from asvhil.files import write_text

if TYPE_CHECKING:
    from asvhil.config.told import Lines

app = typer.Typer(no_args_is_help=True, help="Configs: show, check, explain, and a schema for editors.")

VERDICT = {"pass": "right", "warn": "can be run, but mind the warning", "fail": "cannot be run"}

KeyArgument = Annotated[str, typer.Argument(help="A key, such as supervisor.geofence; all by default.")]
FileOption = Annotated[Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write it to this file.")]


@app.command()
def show(
    config: ConfigArgument,
    key: KeyArgument = "",
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    set_only: Annotated[bool, typer.Option("--set-only", help="Only what is set, not the defaults.")] = False,
    json_: Annotated[Path | None, json_option("the whole config")] = None,
) -> None:
    """Show a config with its bases, overrides and defaults: each key, and where it is set."""
    from rich.console import Console

    from asvhil.config.loading import load_with_places

    check_figures(json_, *config_and_bases(config))
    settings, places = load_with_places(config, tuple(set_))
    tree: Any = settings.model_dump(mode="json")
    write_json(json_, tree)
    path = tuple(key.split(".")) if key else ()
    for part in path:
        if not isinstance(tree, dict) or part not in tree:
            raise ConfigError(f"{key}: no such key{_near(part, tree)}")
        tree = tree[part]
    console = Console()
    for line in _yaml(tree, path, places, 0, set_only):
        say(console, line)


@app.command()
def check(
    config: ConfigArgument,
    set_: SetOption = [],  # noqa: B006 - typer copies its defaults
    json_: Annotated[Path | None, json_option("what was found")] = None,
) -> None:
    """Check a config without a boat: its keys, and whose hull and model are in use; exit 1 where it cannot be run."""
    from rich.console import Console

    from asvhil.config import load_config
    from asvhil.config.borrowed import borrowed_from, chain_of
    from asvhil.config.loading import is_shipped
    from asvhil.preflight.computer import boat_checks, simulation_checks
    from asvhil.preflight.table import as_json, worst

    check_figures(json_, *config_and_bases(config))
    settings = load_config(config, tuple(set_))
    files = [f"{path}{' (shipped)' if is_shipped(path) else ''}" for path in chain_of(config)]
    checks = [*boat_checks(settings, borrowed_from(config, set_)), *simulation_checks(settings)]
    console = Console()
    say(console, f"files: {', over '.join(files)}")
    for link, spec in settings.links.endpoints.items():
        say(console, f"link {link}: {spec}")
    say(console, f"controller: {settings.controller.name}")
    for one in checks:
        say(console, f"{one.item}: {one.result}: {one.found}{f'; {one.todo}' if one.todo else ''}")
    result = worst(checks)
    say(console, f"{config}: {VERDICT[result.value]}")
    write_json(json_, {"files": files, "result": result.value, "checks": [as_json(one) for one in checks]})
    if result == "fail":
        raise typer.Exit(1)


@app.command()
def docs(
    key: KeyArgument = "",
    about: Annotated[str, typer.Option(metavar="WORD", help="All keys whose name or meaning has this word.")] = "",
) -> None:
    """Tell what a key of the config does: its values, unit, default and meaning."""
    from rich.console import Console

    from asvhil.config.key_docs import key_lines, keys_about

    if key and about:
        raise ConfigError("config docs: give a key or --about, not both")
    lines = keys_about(about) if about else key_lines(key)
    if not lines:
        raise ConfigError(f"--about {about}: no key has this word")
    console = Console()
    for name, words in lines:
        say(console, f"{name}: {words}" if name else words)


@app.command()
def schema(output: FileOption = None) -> None:
    """Print the JSON Schema of config files, by which an editor completes and checks keys while you type."""
    from asvhil.config.editor_schema import editor_schema

    check_json(output, "--output ")
    text = json.dumps(editor_schema(), indent=2)
    if output is None:
        typer.echo(text)
        return
    with writing(output, "--output "):
        write_text(output, text + "\n")
    typer.echo(f"{output}: name it in the first line of a config: # yaml-language-server: $schema={output}")


def _near(part: str, tree: Any) -> str:
    import difflib

    near = difflib.get_close_matches(part, tree, n=1) if isinstance(tree, dict) else []
    return f", did you mean {near[0]}?" if near else ""


def _yaml(tree: Any, path: tuple[str, ...], places: Lines, depth: int, set_only: bool) -> Iterator[str]:
    """The lines of a tree of plain values; behind each that is set the place where it is."""
    indent = "  " * depth
    if not isinstance(tree, Mapping):
        yield f"{indent}{_value(tree)}{_place(path, places)}"
        return
    for key, value in tree.items():
        here = (*path, str(key))
        if isinstance(value, Mapping) and value:
            below = list(_yaml(value, here, places, depth + 1, set_only))
            if below:
                yield f"{indent}{key}:{_place(here, places)}"
                yield from below
        elif not set_only or here in places:
            yield f"{indent}{key}: {_value(value)}{_place(here, places)}"


def _place(path: tuple[str, ...], places: Lines) -> str:
    """A comment that says where a key is set; empty for a default."""
    return f"   # {places[path]}" if path in places else ""


def _value(value: Any) -> str:
    """A plain value as YAML on one line, of which JSON is a part."""
    return json.dumps(value)
