"""The table of a campaign: one row for each run, in the order of the design, and its Parquet file."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from asvhil.errors import AsvhilError
from asvhil.files import replacement, shown
from asvhil.study.campaigns.columns import ERROR, FIGURES
from asvhil.study.campaigns.design import PlannedRun
from asvhil.study.campaigns.spec import CampaignSpec
from asvhil.study.store import RESUMES

Row = dict[str, Any]


def row_of(run: PlannedRun, result: Mapping[str, Any], error: str) -> Row:
    """One run: its place, the values of the parameters, the figures (None of a run that failed), and its error."""
    figures: dict[str, Any] = {}
    for name, path in FIGURES.items():
        value: Any = result
        for part in path:
            value = value.get(part) if isinstance(value, Mapping) else value
        if not isinstance(value, int | float | None):
            raise AsvhilError(f"run {run.number}: {name} of its stored result is no number; delete it from the store")
        figures[name] = value
    return {
        "run": run.number,
        "point": run.point,
        "variant": run.variant,
        "repeat": run.repeat,
        "seed": run.seed,
        **run.values,
        **figures,
        ERROR: error,
    }


def write_parquet(spec: CampaignSpec, rows: Sequence[Row], path: Path) -> None:
    """Write the table, all at once or not at all; the campaign's file is in its metadata, as JSON under `campaign`.

    Columns: those of `row_of`; a parameter is float64 where all its values are numbers, else text. AsvhilError without
    pyarrow, and where it cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    types: dict[str, Any] = dict.fromkeys(("run", "point", "repeat", "seed"), pa.int64())
    types |= {name: pa.float64() if p.is_number else pa.string() for name, p in spec.parameters.items()}
    types |= dict.fromkeys(FIGURES, pa.float64())
    fields = [pa.field(name, types.get(name, pa.string())) for name in rows[0]]
    columns = [
        pa.array([_cell(row[field.name], field.type == pa.string()) for row in rows], field.type) for field in fields
    ]
    table = pa.Table.from_arrays(columns, schema=pa.schema(fields, {"campaign": shown(spec.canonical_json())}))
    try:
        with replacement(path) as part, part.open("wb") as file:  # opened here: not every name may go through pyarrow
            pq.write_table(table, file, compression="zstd")
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be written ({os.strerror(error.errno or 0)}); {RESUMES}") from None


def _cell(value: Any, as_text: bool) -> Any:
    return shown(str(value)) if as_text and value is not None else value


def check_parts() -> None:
    """AsvhilError where a package that campaigns need is not installed."""
    for module, what in (("pyarrow", "pyarrow"), ("scipy", "SciPy")):
        try:
            __import__(module)
        except ImportError:
            raise AsvhilError(f"a campaign needs {what}: install asvhil[campaign]") from None
