"""The dataset's front door: records, and what makes them out of logs and CSV files. No torch."""

from __future__ import annotations

from asvhil.train.records import Array, Dataset, Ranges, Segment, ranges, split

__all__ = ["Array", "Dataset", "Ranges", "Segment", "ranges", "split"]
