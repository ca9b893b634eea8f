"""The record of a search: its settings and every candidate with its scores, as JSON, written after each generation."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asvhil.errors import AsvhilError
from asvhil.files import write_text
from asvhil.study.store import RESUMES

if TYPE_CHECKING:
    from asvhil.study.search_spaces import Parameter

Candidate = dict[str, Any]


def stored(path: Path, found: Mapping[str, Any], space: Sequence[Parameter], population: int) -> list[list[Candidate]]:
    """The stored generations of a search. AsvhilError where the file is damaged or of other settings."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        had = {"controller": record["controller"], **record["settings"]}
        asked = {"controller": found["controller"], **found["settings"]}
        for key in [*asked, *had]:
            if had.get(key) != asked.get(key):
                words = f"its search had {key} {json.dumps(had.get(key))}, this one has {json.dumps(asked.get(key))}"
                raise AsvhilError(f"{path}: {words}; move it away to begin anew")
        generations = [[_candidate(one, space) for one in generation] for generation in record["generations"]]
        if any(len(one) != (population if number else 1) for number, one in enumerate(generations)):
            raise ValueError("a generation is not whole")
        return generations
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise AsvhilError(f"{path}: not a whole record of a search; move it away to begin anew") from None


def is_record(tree: Any) -> bool:
    """Whether what a JSON file holds is the record of a search."""
    return isinstance(tree, dict) and {"controller", "settings", "generations"} <= tree.keys()


def _candidate(row: Mapping[str, Any], space: Sequence[Parameter]) -> Candidate:
    typical_ps, values = row["typical_ps"], {key: float(value) for key, value in row["values"].items()}
    shares = [float(share) for share in row["shares"]]
    if len(shares) != len(space) or set(values) != {parameter.key for parameter in space}:
        raise ValueError("a candidate has other values than the search")
    return {
        "shares": shares,
        "values": values,
        "ps": list(row["ps"]),
        "typical_ps": None if typical_ps is None else float(typical_ps),
    }


def save(path: Path, found: Mapping[str, Any]) -> None:
    """Write the record as a whole. AsvhilError where it cannot be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps(found, indent=1) + "\n")
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be written ({error.strerror}); {RESUMES}") from None
