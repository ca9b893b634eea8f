"""YAML as its version 1.2 reads it: text to plain values, with the line of each key. ConfigError, one line, else.

PyYAML scans, parses and composes; what its composed nodes mean is decided here, by the core schema of YAML 1.2: 1:30,
010 and `yes` are not 90, 8 and true. A key stands once in its mapping. Anchors, aliases and merge keys (`<<`) are
taken, up to a size that no config reaches.
"""

from __future__ import annotations

import functools
import math
import re
from pathlib import Path
from typing import Any

import yaml
from yaml.composer import Composer
from yaml.parser import Parser
from yaml.reader import Reader, ReaderError
from yaml.resolver import BaseResolver
from yaml.scanner import Scanner

from asvhil.errors import ConfigError
from asvhil.types import record

MOST_NODES = 100_000  # with all aliases written out
DEEPEST = 50
MERGE = "<<"

Path_ = tuple[str | int, ...]

_TAG = "tag:yaml.org,2002:"
_PLAIN = "plain"  # the tag that a scalar without quotes and without a tag of its own gets here
_NULL = re.compile(r"~|null|Null|NULL|")
_BOOL = re.compile(r"(true|True|TRUE)|false|False|FALSE")
_INT = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"([-+]?)\.(inf|Inf|INF)")
_NAN = re.compile(r"\.(nan|NaN|NAN)")
_OF_TAGS: dict[str, Any] = {"int": int, "float": (int, float), "bool": bool, "null": type(None)}
MOST_BYTES = 500_000  # reading a text takes seconds from here on
_MOST_DIGITS = 400  # beyond any number


@record
class YamlText:
    """The values of a YAML text, and the line (from 1) of each key or item by its path."""

    tree: Any
    lines: dict[Path_, int]


def read_yaml(path: Path) -> YamlText:
    """A file of UTF-8 text, with or without a byte order mark. ConfigError names the file, and mostly the line."""
    try:
        data = path.read_bytes()
        if len(data) > MOST_BYTES:
            words = f"{len(data) / 1e6:.1f} MB, a config has {MOST_BYTES / 1e6:.1f} MB at most"
            raise ConfigError(f"{path}: cannot be read ({words})")
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        kind = "UTF-16 text, " if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ""
        raise ConfigError(f"{path}: cannot be read ({kind}not UTF-8 text: save it as UTF-8)") from None
    return parse_yaml(text, str(path))


def parse_yaml(text: str, source: str) -> YamlText:
    """The one document in a text. ConfigError begins with `source` where it is not valid."""
    try:
        root = _composed(text)
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise ConfigError(
            f"{source}: not valid YAML at line {line} (a character that is no text, code {error.character})"
        ) from None
    except yaml.MarkedYAMLError as error:
        raise ConfigError(f"{source}: {_told(error)}") from None
    except RecursionError:
        raise ConfigError(f"{source}: nested too deeply; at most {DEEPEST} levels are taken") from None
    except (yaml.YAMLError, ValueError, OverflowError) as error:  # of \UFFFFFFFF in quotes
        raise ConfigError(f"{source}: not valid YAML ({error})".replace("\n", " ")) from None
    builder = _Builder(source)
    tree = None if root is None else builder.value(root, ())
    return YamlText(tree=tree, lines=builder.lines)


@functools.lru_cache(maxsize=64)
def _composed(text: str) -> yaml.Node | None:
    """The root of a text's nodes, which nobody changes: a study reads the same few files for each of its runs."""
    return _Loader(text).get_single_node()


def _told(error: yaml.MarkedYAMLError) -> str:
    """What the parser complains of, in one line."""
    mark = error.problem_mark or error.context_mark
    where = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
    problem = error.problem or error.context or "cannot be parsed"
    if "'\\t'" in problem:
        problem = "a tab, where YAML takes spaces alone"
    if error.context == "expected a single document in the stream":
        return f"holds several documents, the second{where}; one is expected"
    return f"not valid YAML{where} ({problem})".replace("\n", " ")


class _Resolver(BaseResolver):
    """Leaves what a plain scalar is to `_Builder`."""

    def resolve(self, kind: type, value: Any, implicit: Any) -> str:
        if kind is yaml.ScalarNode and implicit[0]:
            return _PLAIN
        return str(super().resolve(kind, value, implicit))  # type: ignore[no-untyped-call]


class _Loader(Reader, Scanner, Parser, Composer, _Resolver):
    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)
        Composer.__init__(self)
        _Resolver.__init__(self)


class _Builder:
    """Nodes to values. Aliases are written out, so that no two places of the tree share a value."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._nodes = 0
        self._open: set[int] = set()
        self.lines: dict[Path_, int] = {}

    def value(self, node: yaml.Node, path: Path_) -> Any:
        """What a node holds, at its path."""
        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise self._error(node, path, f"more than {MOST_NODES} values, aliases written out")
        if len(path) > DEEPEST:
            raise self._error(node, path, f"nested too deeply; at most {DEEPEST} levels are taken")
        if id(node) in self._open:
            raise self._error(node, path, "an alias inside of what it stands for")
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, path)
        assert isinstance(node, yaml.SequenceNode | yaml.MappingNode)
        expected = "seq" if isinstance(node, yaml.SequenceNode) else "map"
        if node.tag != _TAG + expected:
            raise self._error(node, path, f"the tag {_short(node.tag)} means nothing here; leave it out")
        self._open.add(id(node))
        try:
            if isinstance(node, yaml.SequenceNode):
                return [self._at(item, (*path, number)) for number, item in enumerate(node.value)]
            return self._mapping(node, path)
        finally:
            self._open.discard(id(node))

    def _at(self, node: yaml.Node, path: Path_) -> Any:
        self.lines[path] = _line(node)
        return self.value(node, path)

    def _mapping(self, node: yaml.MappingNode, path: Path_) -> dict[str, Any]:
        places: dict[str, tuple[yaml.Node, yaml.Node]] = {}
        for key_node, value_node in node.value:
            key = MERGE if _is_merge(key_node) else self._key(key_node, path)
            if key in places:
                again = f"in line {_line(places[key][0])} and again in line {_line(key_node)}; once is right"
                raise ConfigError(f"{self._source}: key {_dotted((*path, key))}: given twice, {again}")
            places[key] = key_node, value_node
        found: dict[str, Any] = {}
        if MERGE in places:
            found = self._merged(places.pop(MERGE)[1], path)
        for key, (key_node, value_node) in places.items():
            self.lines[(*path, key)] = _line(key_node)
            found[key] = self.value(value_node, (*path, key))
        return found

    def _merged(self, node: yaml.Node, path: Path_) -> dict[str, Any]:
        """What stands behind `<<`: a mapping, or several, of which the first has precedence."""
        found: dict[str, Any] = {}
        for source in reversed(node.value) if isinstance(node, yaml.SequenceNode) else (node,):
            if not isinstance(source, yaml.MappingNode):
                raise self._error(source, path, "<< takes a mapping, or a list of them, such as <<: *anchor")
            found |= self.value(source, path)
        return found

    def _key(self, node: yaml.Node, path: Path_) -> str:
        if isinstance(node, yaml.ScalarNode):
            key = self._scalar(node, path)
            if isinstance(key, str):
                return key
            what = f"{node.value!r} is {_what(key)}; in quotes it would be text"
        else:
            what = "this is a mapping or a list"
        raise self._error(node, path, f"a key must be text, and {what}")

    def _scalar(self, node: yaml.ScalarNode, path: Path_) -> Any:
        text = node.value
        if node.tag == _TAG + "str":
            return text
        value = scalar(text)
        if node.tag == _PLAIN:
            return value
        name = node.tag.removeprefix(_TAG)
        kind = _OF_TAGS.get(name)
        if kind is None or node.tag == name:
            raise self._error(node, path, f"the tag {_short(node.tag)} means nothing here; leave it out")
        if not isinstance(value, kind) or (isinstance(value, bool) and name != "bool"):
            raise self._error(node, path, f"{text!r} is not of its tag {_short(node.tag)}")
        return float(value) if name == "float" else value

    def _error(self, node: yaml.Node, path: Path_, message: str) -> ConfigError:
        key = f"key {_dotted(path)}: " if path else ""
        return ConfigError(f"{self._source}: {key}{message} (line {_line(node)})")


def scalar(text: str) -> Any:
    """A plain scalar by the core schema of YAML 1.2: None, bool, int, float, else the text itself."""
    if _NULL.fullmatch(text):
        return None
    if found := _BOOL.fullmatch(text):
        return found[1] is not None
    if len(text) > _MOST_DIGITS:
        return text
    if _INT.fullmatch(text):
        return int(text)
    if _BASED.fullmatch(text):
        return int(text[2:], 8 if text[1] == "o" else 16)
    if _FLOAT.fullmatch(text):
        return float(text)
    if found := _INFINITE.fullmatch(text):
        return -math.inf if found[1] == "-" else math.inf
    return math.nan if _NAN.fullmatch(text) else text


def _is_merge(node: yaml.Node) -> bool:
    return isinstance(node, yaml.ScalarNode) and node.tag in (_PLAIN, _TAG + "merge") and node.value == MERGE


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1


def _dotted(path: Path_) -> str:
    return ".".join(map(str, path))


def _short(tag: str) -> str:
    return f"!!{tag.removeprefix(_TAG)}" if tag.startswith(_TAG) else tag


def _what(value: Any) -> str:
    if value is None:
        return "empty"
    return "true or false" if isinstance(value, bool) else "a number"
