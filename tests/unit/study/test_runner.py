"""The runner of studies: stored runs are kept, unfinished ones run again, and no process is left."""

import contextlib
import dataclasses
import fcntl
import gc
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from asvhil.errors import AsvhilError
from asvhil.study import code_version, executors, runner
from asvhil.study.made_of import run_files
from asvhil.study.runner import Job, run_jobs
from asvhil.study.store import _parsed, _without_sum
from tests.support.paths import ROOT
from tests.support.study_jobs import die_at_three, fail_at_three, jobs, leave_circles, square
from tests.support.waiting import wait_until


def ran(folder: Path) -> list[int]:
    file = folder / "ran.txt"
    return [int(line) for line in file.read_text().split()] if file.exists() else []


def squares(finished: runner.Finished) -> list[float]:
    return [result["square"] for result in finished.results]


@pytest.mark.parametrize(
    "change", [('"square": 4.0', '"square": 5.0'), ('"square": 4.0', '"square": "x"'), ('"wall_s"', '"wall"')]
)
def test_a_stored_run_that_was_edited_or_damaged_is_none(tmp_path, change):
    store = tmp_path / "store.jsonl"
    run_jobs(square, jobs(tmp_path, 3), store, workers=0)
    store.write_text(store.read_text().replace(*change, 1))
    with pytest.raises(AsvhilError, match=r"store\.jsonl: line \d is not a stored run; delete it"):
        run_jobs(square, jobs(tmp_path, 3), store, workers=0)


def test_a_store_that_is_no_file_is_not_read(tmp_path):
    (tmp_path / "store.jsonl").symlink_to("/dev/full")
    with pytest.raises(AsvhilError, match=r"store\.jsonl: is no regular file"):
        run_jobs(square, jobs(tmp_path, 1), tmp_path / "store.jsonl", workers=0)


def test_results_are_in_the_order_of_the_jobs_and_what_is_stored_is_not_run_again(tmp_path):
    store = tmp_path / "store.jsonl"
    seen = []
    first = run_jobs(square, jobs(tmp_path, 5), store, workers=2, tell=seen.append)
    assert squares(first) == [1.0, 4.0, 9.0, 16.0, 25.0] and first.processes == 2
    assert os.getpid() not in {result["pid"] for result in first.results}
    assert [now.done for now in seen] == [0, 1, 2, 3, 4, 5]
    again = run_jobs(square, jobs(tmp_path, 6), store, workers=0)
    assert squares(again) == [1.0, 4.0, 9.0, 16.0, 25.0, 36.0]
    assert sorted(ran(tmp_path)) == [1, 2, 3, 4, 5, 6]
    assert again.results[:5] == first.results


def code(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    for module in (executors, runner):
        monkeypatch.setattr(module, "code_version", lambda: name)


def timed_square(number: int, folder: str) -> dict[str, float]:
    return {key: value for key, value in square(number, folder).items() if key != "pid"} | {
        "spent_ms": float(len(folder))
    }


def otherwise_from_four(number: int, folder: str) -> dict[str, float]:
    """The same to three but for the time that it took; from four on another result."""
    result = timed_square(number, folder)
    return {"square": result["square"] * (1.0 if number < 4 else 2.0), "spent_ms": 7.0}


def test_runs_of_other_code_are_drawn_run_again_and_counted_once_for_all(tmp_path, monkeypatch):
    store, told = tmp_path / "store.jsonl", []
    code(monkeypatch, "old")
    run_jobs(timed_square, jobs(tmp_path, 3), store, workers=0)
    code(monkeypatch, "new")
    first = run_jobs(otherwise_from_four, jobs(tmp_path, 3), store, workers=0, confirm=2, tell=told.append)
    assert (first.outdated, first.again, first.changed) == (1, 2, 0) and len(ran(tmp_path)) == 5
    assert [(now.outdated, now.again) for now in (told[0], told[-1])] == [(1, 0), (0, 2)]
    later = run_jobs(otherwise_from_four, jobs(tmp_path, 3), store, workers=0)
    assert (later.outdated, later.again, later.changed) == (1, 2, 0) and len(ran(tmp_path)) == 5
    more = run_jobs(otherwise_from_four, jobs(tmp_path, 3), store, workers=0, confirm=9)
    assert (more.outdated, more.again, more.changed) == (0, 3, 0) and sorted(ran(tmp_path)) == [1, 1, 2, 2, 3, 3]
    code(monkeypatch, "newer")
    assert run_jobs(timed_square, jobs(tmp_path, 3), store, workers=0).again == 0


def test_a_run_that_comes_out_otherwise_is_counted_and_takes_the_place_of_the_older(tmp_path, monkeypatch):
    store = tmp_path / "store.jsonl"
    code(monkeypatch, "old")
    run_jobs(timed_square, jobs(tmp_path, 5), store, workers=0)
    code(monkeypatch, "new")
    found = run_jobs(otherwise_from_four, jobs(tmp_path, 5), store, workers=0, confirm=5)
    assert (found.outdated, found.again, found.changed) == (0, 5, 2)
    assert squares(found) == [1.0, 4.0, 9.0, 32.0, 50.0]
    assert run_jobs(otherwise_from_four, jobs(tmp_path, 5), store, workers=0).changed == 2


def with_a_new_figure(number: int, folder: str) -> dict[str, float]:
    return timed_square(number, folder) | {"cube": float(number**3)}


def test_a_figure_that_is_new_is_no_change(tmp_path, monkeypatch):
    store = tmp_path / "store.jsonl"
    code(monkeypatch, "old")
    run_jobs(timed_square, jobs(tmp_path, 3), store, workers=0)
    code(monkeypatch, "new")
    found = run_jobs(with_a_new_figure, jobs(tmp_path, 3), store, workers=0, confirm=2)
    assert (found.again, found.changed) == (2, 0)
    code(monkeypatch, "newer")
    assert run_jobs(timed_square, jobs(tmp_path, 3), store, workers=0, confirm=3).changed == 2  # a figure is gone


def test_a_job_with_code_of_its_own_is_older_only_when_that_changes(tmp_path, monkeypatch):
    def bounds(version: str) -> list[Job]:
        return [dataclasses.replace(job, code=version) for job in jobs(tmp_path, 2)]

    store = tmp_path / "store.jsonl"
    code(monkeypatch, "old")
    run_jobs(timed_square, bounds("a"), store, workers=0)
    code(monkeypatch, "new")
    assert run_jobs(timed_square, bounds("a"), store, workers=0).outdated == 0
    assert run_jobs(timed_square, bounds("b"), store, workers=0).outdated == 2


def test_the_same_run_asked_for_twice_is_run_once(tmp_path):
    finished = run_jobs(square, jobs(tmp_path, 2) + jobs(tmp_path, 2), tmp_path / "store.jsonl", workers=0)
    assert squares(finished) == [1.0, 4.0, 1.0, 4.0] and ran(tmp_path) == [1, 2]


def test_a_line_that_was_cut_off_is_run_again_and_leaves_a_whole_store(tmp_path):
    store = tmp_path / "store.jsonl"
    run_jobs(square, jobs(tmp_path, 3), store, workers=0)
    text = store.read_text()
    for cut in (2, 20, len(text.splitlines()[-1])):
        store.write_text(text[:-cut])
        (tmp_path / "ran.txt").unlink()
        seen = []
        finished = run_jobs(square, jobs(tmp_path, 3), store, workers=0, tell=seen.append)
        assert squares(finished) == [1.0, 4.0, 9.0] and ran(tmp_path) == [3]
        assert len([json.loads(line) for line in store.read_text().splitlines()]) == 3
        assert [bool(now.note) for now in seen] == [True, False]
        assert seen[0].note.startswith(f"{store}: the last line was cut off")


def test_a_whole_line_without_its_end_is_kept(tmp_path):
    store = tmp_path / "store.jsonl"
    run_jobs(square, jobs(tmp_path, 3), store, workers=0)
    text = store.read_text()
    store.write_text(text[:-1])
    seen = []
    assert len(run_jobs(square, jobs(tmp_path, 4), store, workers=0, tell=seen.append).results) == 4
    assert ran(tmp_path) == [1, 2, 3, 4] and store.read_text().startswith(text)
    assert store.read_text().count("\n") == 4 and not any(now.note for now in seen)


@pytest.mark.parametrize("content", [b"ab\xff\xfebin\n", b"ab\xff\xfebin", b"\x00\x00", b"my notes"])
def test_a_file_that_is_no_store_is_left_alone_and_named(tmp_path, content):
    store = tmp_path / "store.jsonl"
    store.write_bytes(content)
    with pytest.raises(AsvhilError, match=r"store\.jsonl: line 1 is not a stored run"):
        run_jobs(square, jobs(tmp_path, 1), store, workers=0)
    assert store.read_bytes() == content


@pytest.mark.parametrize("tail", [b'{"key": "\xff\xfe', b'{"key": "s\xc3', b"\x00" * 40])
def test_a_last_line_that_was_cut_off_among_its_bytes_is_dropped(tmp_path, tail):
    store = tmp_path / "store.jsonl"
    run_jobs(square, jobs(tmp_path, 2), store, workers=0)
    whole = store.read_bytes()
    store.write_bytes(whole + tail)
    seen = []
    assert squares(run_jobs(square, jobs(tmp_path, 2), store, workers=0, tell=seen.append)) == [1.0, 4.0]
    assert store.read_bytes() == whole and "the last line was cut off" in seen[0].note
    assert ran(tmp_path) == [1, 2]


def test_a_flipped_bit_is_named_with_its_line_wherever_it_is(tmp_path):
    store = tmp_path / "store.jsonl"
    run_jobs(square, jobs(tmp_path, 3), store, workers=0)
    lines = store.read_bytes().splitlines(keepends=True)
    for at in range(len(lines[1]) - 1):
        for bit in (0x01, 0x80):
            flipped = bytearray(lines[1])
            flipped[at] ^= bit
            if b"\n" in flipped[:-1] or b"\r" in flipped:
                continue
            store.write_bytes(lines[0] + flipped + lines[2])
            with pytest.raises(AsvhilError, match=r"store\.jsonl: line 2 (is not a stored run|has lost)"):
                run_jobs(square, jobs(tmp_path, 3), store, workers=0)


def without_sum(line: str) -> str:
    return line.partition(', "crc"')[0] + "}\n"


def test_an_edited_line_without_its_sum_is_refused_by_its_number(tmp_path):
    store = tmp_path / "store.jsonl"
    run_jobs(square, jobs(tmp_path, 3), store, workers=0)
    lines = store.read_text().splitlines(keepends=True)
    store.write_text(lines[0] + without_sum(lines[1].replace('"square": 4.0', '"square": 5.0')) + lines[2])
    with pytest.raises(AsvhilError, match=r"store\.jsonl: line 2 has lost its checksum"):
        run_jobs(square, jobs(tmp_path, 3), store, workers=0)


@pytest.mark.parametrize(("bare", "words"), [(2, "lines 2, 3 have"), (12, "lines 2, 3, 4, 5, 6 and 7 more have")])
def test_all_lines_that_lost_their_sum_are_named_at_once(tmp_path, bare, words):
    store = tmp_path / "store.jsonl"
    run_jobs(square, jobs(tmp_path, bare + 1), store, workers=0)
    first, *others = store.read_text().splitlines(keepends=True)
    store.write_text(first + "".join(without_sum(line) for line in others))
    with pytest.raises(AsvhilError, match=rf"store\.jsonl: {words} lost their checksum.* delete them"):
        run_jobs(square, jobs(tmp_path, bare + 1), store, workers=0)


def test_lines_of_code_from_before_there_were_sums_are_taken_and_counted(tmp_path, monkeypatch):
    store = tmp_path / "store.jsonl"
    with monkeypatch.context() as earlier:
        earlier.setattr(executors, "code_version", lambda: "older")
        run_jobs(square, jobs(tmp_path, 3), store, workers=0)
    store.write_text("".join(without_sum(line) for line in store.read_text().splitlines()))
    seen = []
    assert squares(run_jobs(square, jobs(tmp_path, 4), store, workers=0, tell=seen.append)) == [1.0, 4.0, 9.0, 16.0]
    assert seen[0].note.startswith(f"{store}: 3 lines have no checksum") and not any(now.note for now in seen[1:])


def test_the_committed_stores_are_taken_as_they_are():
    for path in sorted((ROOT / "docs" / "results").glob("*.jsonl")):
        content = path.read_bytes()
        assert _parsed(path, content)
        assert bool(_without_sum(path, content)) == (path.name == "trials.jsonl")


@pytest.mark.parametrize(
    "line", ["not JSON", "[1, 2]", '{"key": "square 1"}', '{"key": "k", "code": "", "wall_s": "x"}']
)
def test_damage_is_named_with_its_line(tmp_path, line):
    store = tmp_path / "store.jsonl"
    run_jobs(square, jobs(tmp_path, 1), store, workers=0)
    with store.open("a") as file:
        file.write(f"{line}\n")
    with pytest.raises(AsvhilError, match=r"store\.jsonl: line 2 is not a stored run"):
        run_jobs(square, jobs(tmp_path, 2), store, workers=0)


def test_a_store_in_use_or_out_of_reach_is_one_line(tmp_path):
    store = tmp_path / "store.jsonl"
    with store.open("a") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        with pytest.raises(AsvhilError, match="another study is writing to it"):
            run_jobs(square, jobs(tmp_path, 1), store, workers=0)
    with pytest.raises(AsvhilError, match=r"ran\.txt.*cannot be"):
        (tmp_path / "ran.txt").write_text("")
        run_jobs(square, jobs(tmp_path, 1), tmp_path / "ran.txt" / "store.jsonl", workers=0)


def test_an_error_in_a_job_comes_through_and_what_was_done_stays(tmp_path):
    store = tmp_path / "store.jsonl"
    with pytest.raises(ValueError, match="three"):
        run_jobs(fail_at_three, jobs(tmp_path, 4), store, workers=0)
    assert squares(run_jobs(square, jobs(tmp_path, 2), store, workers=0)) == [1.0, 4.0]
    with pytest.raises(ValueError, match="three"):
        run_jobs(fail_at_three, jobs(tmp_path, 40), store, workers=1)
    assert ran(tmp_path).count(1) == ran(tmp_path).count(2) == 1


def test_an_isolated_error_is_stored_with_its_job_and_run_again_when_asked(tmp_path):
    store = tmp_path / "store.jsonl"
    finished = run_jobs(fail_at_three, jobs(tmp_path, 4), store, workers=0, isolate=True)
    assert finished.errors == {"square 3": "ValueError: three"} and finished.results[2] == {}
    assert [bool(result) for result in finished.results] == [True, True, False, True]
    # Taken up again it is what it was; a study that isolates nothing, and one that tries again, run it.
    assert run_jobs(square, jobs(tmp_path, 4), store, workers=0, isolate=True).errors == finished.errors
    assert ran(tmp_path) == [1, 2, 4]
    with pytest.raises(ValueError, match="three"):
        run_jobs(fail_at_three, jobs(tmp_path, 4), store, workers=0)
    again = run_jobs(square, jobs(tmp_path, 4), store, workers=0, isolate=True, retry=True)
    assert not again.errors and squares(again) == [1.0, 4.0, 9.0, 16.0] and ran(tmp_path) == [1, 2, 4, 3]


def test_a_job_that_ends_its_process_fails_alone(tmp_path):
    finished = run_jobs(die_at_three, jobs(tmp_path, 7), tmp_path / "store.jsonl", workers=1, isolate=True)
    assert list(finished.errors) == ["square 3"] and "its process died" in finished.errors["square 3"]
    assert [result.get("square") for result in finished.results] == [1.0, 4.0, None, 16.0, 25.0, 36.0, 49.0]
    assert finished.processes == 1 and finished.runs_now == 7


def test_a_process_of_runs_collects_garbage_between_them_and_seldom_within_one(tmp_path):
    before = gc.get_threshold(), gc.get_freeze_count()
    finished = run_jobs(leave_circles, jobs(tmp_path, 6), tmp_path / "store.jsonl", workers=1)
    assert [result["left"] for result in finished.results] == [0.0] * 6, "memory does not grow with the runs"
    assert min(result["threshold"] for result in finished.results) > 10 * before[0][0]
    assert (gc.get_threshold(), gc.get_freeze_count()) == before, "this process is as it was"


def test_how_long_a_process_waited_for_its_next_run_is_known_but_for_its_first(tmp_path):
    assert run_jobs(square, jobs(tmp_path, 1), tmp_path / "one.jsonl", workers=0).idle_s is None
    idle_s = run_jobs(square, jobs(tmp_path, 4), tmp_path / "four.jsonl", workers=0).idle_s
    assert idle_s is not None and 0.0 <= idle_s < 1.0


def test_the_time_to_go_is_known_once_every_group_has_a_run(tmp_path, monkeypatch):
    ticks = iter(range(100))
    monkeypatch.setattr(executors.time, "perf_counter", lambda: float(next(ticks)))  # every run takes 1 s
    mixed = [*jobs(tmp_path, 3, "quick"), *[Job(key="slow 4", group="slow", arguments=(4, str(tmp_path)))]]
    seen = []
    finished = run_jobs(square, mixed, tmp_path / "store.jsonl", workers=0, tell=seen.append)
    assert [now.remaining_s for now in seen] == [None, None, None, None, 0.0]
    assert seen[-1].total_s == 4.0 and finished.group_s == {"quick": 3.0, "slow": 1.0}
    more = [*mixed, Job(key="slow 5", group="slow", arguments=(5, str(tmp_path)))]
    seen.clear()
    run_jobs(square, more, tmp_path / "store.jsonl", workers=0, tell=seen.append)
    assert (seen[0].done, seen[0].remaining_s, seen[0].total_s) == (4, 1.0, 5.0)


def test_runs_of_other_code_are_counted(tmp_path, monkeypatch):
    store = tmp_path / "store.jsonl"
    assert run_jobs(square, jobs(tmp_path, 2), store, workers=0).outdated == 0
    for module in (runner, executors):
        monkeypatch.setattr(module, "code_version", lambda: "another")
    assert run_jobs(square, jobs(tmp_path, 3), store, workers=0).outdated == 2


def test_the_version_of_the_code_follows_the_sources_that_decide(tmp_path, monkeypatch):
    assert all((code_version.PACKAGE / name).exists() for name in code_version.DECISIVE)
    (tmp_path / "a.py").write_text("x = 1\n")
    (tmp_path / "b.py").write_text("y = 1\n")
    monkeypatch.setattr(code_version, "PACKAGE", tmp_path)
    monkeypatch.setattr(code_version, "DECISIVE", ("a.py",))
    first = code_version.code_version.__wrapped__()
    (tmp_path / "b.py").write_text("y = 2\n")
    assert code_version.code_version.__wrapped__() == first
    (tmp_path / "a.py").write_text("x = 2\n")
    assert code_version.code_version.__wrapped__() != first


# Loaded by a run in lockstep, without a say in how it comes out.
NOT_DECISIVE = {
    "__init__.py",  # the version's number
    "errors.py",  # kinds of errors: what raises them is covered
    "files.py",  # how files get their names
    "study/__init__.py",  # empty
}
LOADED = """
import sys
def note(event, arguments):
    if event == "open" and "/config/" in str(arguments[0]) and str(arguments[0]).endswith((".yaml", ".npz")):
        print("file", arguments[0])
sys.addaudithook(note)
from asvhil.config import load_config
from asvhil.study.trials import abrupt, approach, estimation, trial
for keys in ((), ("controller.name=loiter", "controller.procedure.enabled=true")):
    trial.run_trial(load_config("sitl", keys), 0.5, 1.0)
for name, module in list(sys.modules.items()):
    if name.partition(".")[0] == "asvhil":
        print(module.__file__)
"""


def test_all_that_a_run_in_lockstep_loads_is_in_the_version_of_the_code_or_excepted():
    done = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    read = {Path(line.removeprefix("file ")).resolve() for line in lines if line.startswith("file ")}
    assert len(read) == 3 and read == {file.resolve() for file in run_files("sitl")}
    loaded = {str(Path(line).relative_to(code_version.PACKAGE)) for line in lines if not line.startswith("file ")}
    assert {"backseat/backseat.py", "simplant/plant.py", "study/trials/trial.py", "controller/loiter.py"} <= loaded
    covered = {name for name in loaded for part in code_version.DECISIVE if Path(name).is_relative_to(part)}
    assert loaded - covered == NOT_DECISIVE


@contextlib.contextmanager
def study_of(function: str, folder: Path, **popen):
    """A study of two processes, in one of its own, that would go on for long."""
    study = subprocess.Popen(
        [sys.executable, "-m", "tests.support.study_jobs", str(folder), function],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **popen,
    )
    try:
        yield study
    finally:
        for pid in children(study.pid):
            os.kill(pid, signal.SIGKILL)
        study.kill()
        study.communicate()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_study_that_is_killed_leaves_no_process_and_goes_on_where_it_was(tmp_path, number):
    store = tmp_path / "store.jsonl"
    with study_of("linger", tmp_path) as study:
        wait_until(lambda: len(ran(tmp_path)) == 4 and store.read_text().count("\n") == 2, 60.0)
        workers = children(study.pid)
        assert len(workers) >= 2
        study.send_signal(number)
        study.communicate(timeout=60.0)  # ends only when all that share its output have ended
        wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), 60.0)
    finished = run_jobs(square, jobs(tmp_path, 6), store, workers=0)
    assert squares(finished) == [1.0, 4.0, 9.0, 16.0, 25.0, 36.0]
    assert ran(tmp_path).count(1) == ran(tmp_path).count(2) == 1


def test_ctrl_c_while_its_processes_start_is_told_by_the_study_alone(tmp_path):
    with study_of("linger", tmp_path, start_new_session=True) as study:
        wait_until(lambda: len(children(study.pid)) >= 3, 60.0)  # the one that keeps count of semaphores among them
        os.killpg(study.pid, signal.SIGINT)  # as a terminal does
        words, _ = study.communicate(timeout=60.0)
    assert words.count("Traceback") <= 1 and "spawn_main" not in words, words


def test_ctrl_c_ends_a_run_that_does_not_let_python_run(tmp_path):
    with study_of("holds_on", tmp_path) as study:
        wait_until(lambda: len(ran(tmp_path)) == 2, 60.0)
        study.send_signal(signal.SIGINT)
        assert study.wait(timeout=30.0) != 0


def children(pid: int) -> list[int]:
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            parent = int(path.read_text().rpartition(")")[2].split()[1])
            if parent == pid:
                found.append(int(path.parent.name))
    return found
