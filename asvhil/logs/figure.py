"""Writing a drawn figure to a file."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.text import Text

from asvhil.errors import AsvhilError
from asvhil.files import replacement, shown

FORMATS = (".png", ".svg", ".pdf")


def show_names(figure: Figure) -> None:
    """Make the texts of a figure such that they can be drawn: legends and titles have names of files."""
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        if (words := shown(text.get_text())) != text.get_text():
            text.set_text(words)


def save_figure(figure: Figure, path: Path, dpi: int = 110) -> None:
    """The figure in the format of the path's ending. AsvhilError, one line, where it cannot be written."""
    if path.suffix.lower() not in FORMATS:
        raise AsvhilError(f"{path}: a picture ends in {', '.join(FORMATS)}")
    show_names(figure)
    try:
        with replacement(path) as part:
            figure.savefig(part, dpi=dpi)
    except OSError as error:
        raise AsvhilError(f"{path}: cannot be written ({error.strerror or error})") from None
