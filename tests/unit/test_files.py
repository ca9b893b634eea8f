"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from asvhil.files import replacement, whole_file, write_text


def left(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_replacement_takes_its_place_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "figures.json"
    path.write_text("old")
    with replacement(path) as part:
        part.write_text("new")
        assert path.read_text() == "old" and part.suffix == ".json"
    assert path.read_text() == "new" and left(tmp_path) == ["figures.json"]


@pytest.mark.parametrize("there", [True, False])
def test_after_an_error_what_was_there_is_still_there_and_nothing_else(tmp_path: Path, there: bool) -> None:
    path = tmp_path / "page.html"
    if there:
        path.write_text("old")
    with pytest.raises(OSError, match="disk full"), replacement(path) as part:
        part.write_text("half")
        raise OSError("disk full")
    assert left(tmp_path) == (["page.html"] if there else [])
    assert not there or path.read_text() == "old"


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    target, link = tmp_path / "target.yaml", tmp_path / "link.yaml"
    target.write_text("old")
    link.symlink_to(target)
    write_text(link, "new")
    assert link.is_symlink() and target.read_text() == "new"


def test_the_permissions_stay(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text("old")
    path.chmod(0o640)
    write_text(path, "new", sync=True)
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_pipe_is_written_to() -> None:
    reading, writing = os.pipe()
    try:
        write_text(Path(f"/dev/fd/{writing}"), "{}\n")
        assert os.read(reading, 10) == b"{}\n"
    finally:
        os.close(reading)
        os.close(writing)


def test_a_new_file_never_takes_the_place_of_another(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_text("old")
    with pytest.raises(FileExistsError), whole_file(path) as part:
        part.write_text("new")
    assert path.read_text() == "old" and left(tmp_path) == ["run.mcap"]
