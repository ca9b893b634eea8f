"""Writing a drawn figure to a file."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from asvhil.errors import AsvhilError
from asvhil.files import replacement

FORMATS = (".png", ".svg", ".pdf")


def save_figure(figure: Figure, path: Path, dpi: int = 110) -> None:
    """The figure in the format of the path's ending. AsvhilError, one line, where it cannot be written."""
    if path.suffix.lower() not in FORMATS:
        raise AsvhilError(f"{path}: a picture ends in {', '.join(FORMATS)}")
    try:
        with replacement(path) as part:
            figure.savefig(part, dpi=dpi)
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be written ({error.strerror or error})") from None
