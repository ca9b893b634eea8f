"""The public names of datasets: records, and the functions that read them from logs and CSV files. No torch."""

from __future__ import annotations

from asvhil.dynamics.arrays import Array
from asvhil.train.columns import find_columns
from asvhil.train.csv_data import dataset_from_csv
from asvhil.train.log_data import dataset_from_logs, truth_from_log
from asvhil.train.records import Dataset, Ranges, Segment, ranges, split

__all__ = [
    "Array",
    "Dataset",
    "Ranges",
    "Segment",
    "dataset_from_csv",
    "dataset_from_logs",
    "find_columns",
    "ranges",
    "split",
    "truth_from_log",
]
