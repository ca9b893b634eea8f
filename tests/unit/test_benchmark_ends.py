"""How benchmarks end: with a picture or a status, and a mistake is a line."""

import subprocess
import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from bench.effort_front import AXES, draw
from bench.ending import end_in_words
from tests.support.paths import ROOT


def test_the_front_of_efforts_is_drawn_from_the_table_of_a_campaign(tmp_path: Path) -> None:
    runs = [
        {"wind_speed": speed, "variant": name, "ps": 3.0 + number, **{column: 0.1 * number for column, _ in AXES}}
        for speed in (3.0, 6.0)
        for number, name in enumerate(("precise", "normal", "gentle"))
    ]
    pq.write_table(pa.Table.from_pylist(runs), tmp_path / "effort.parquet")
    draw(tmp_path / "effort.parquet", tmp_path / "effort.png")
    assert (tmp_path / "effort.png").read_bytes().startswith(b"\x89PNG")


def test_a_table_that_is_not_there_is_a_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "bench.effort_front", str(tmp_path / "no.parquet"), str(tmp_path / "effort.png")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith("effort_front: ") and done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("raised", "status", "words"),
    [(KeyboardInterrupt(), 130, "interrupted\n"), (OSError("no such port"), 2, ": no such port\n")],
)
def test_an_interrupt_and_an_error_have_their_statuses(
    raised: BaseException, status: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def main() -> None:
        raise raised

    with pytest.raises(SystemExit) as ended:
        end_in_words(main)
    assert ended.value.code == status and capsys.readouterr().err.endswith(words)


def test_a_fault_of_the_benchmark_itself_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError):
        end_in_words(lambda: 1 // 0)
