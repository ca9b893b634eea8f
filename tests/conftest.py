"""Imported before every test: the package keeps NumPy to one thread, which must be said before NumPy is imported."""

import fcntl
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import asvhil
from asvhil.config.plugins import unload_all
from asvhil.dynamics.buffers import evaluate_with
from asvhil.machine_code.compiler import SWITCH, use_compiler

assert asvhil.__version__

# What commands compile is not the user's: one folder for all processes, and the next run finds it.
os.environ.setdefault(SWITCH, f"{tempfile.gettempdir()}/asvhil-tests-{os.getuid()}-machine-code")
# Tests send these to what they start, which would inherit that a shell in the background, or nohup, ignores them.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
# Folders of tests that run long enough for machine code to pay.
LOOPS = {"hil", "loop", "page", "replay", "study", "train"}

# Neither what an example takes nor how fast examples are drawn may decide a test: a busy machine is slow at both.
settings.register_profile("any load", deadline=None, suppress_health_check=[HealthCheck.too_slow], max_examples=30)
settings.load_profile("any load")


@pytest.fixture(scope="session")
def run_logs(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The log of a run of `tests.support.run_logs` by its name: made once, also where tests run in many processes."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent

    def log_of(name: str) -> Path:
        from tests.support import run_logs as runs

        log = shared / f"{name}.mcap"
        with locked(shared / f"{name}.lock", fcntl.LOCK_EX):
            if not log.exists():
                part = shared / f"{name}-part.mcap"
                part.unlink(missing_ok=True)
                getattr(runs, f"record_{name}")(part)
                part.rename(log)
        return log

    return log_of


@pytest.fixture(autouse=True)
def own_plugins() -> Iterator[None]:
    """The plug-ins of a test are not those of the next."""
    yield
    unload_all()


@pytest.fixture(autouse=True)
def machine_code(request: pytest.FixtureRequest) -> None:
    """Loops are run as commands run them; units under test are not compiled, since most are evaluated a few times."""
    if LOOPS & set(request.path.parts):
        use_compiler()
    else:
        evaluate_with(None)


@contextmanager
def locked(path: Path, how: int) -> Iterator[None]:
    with path.open("w") as file:
        fcntl.flock(file, how)
        yield


@pytest.fixture(autouse=True)
def company(request: pytest.FixtureRequest) -> Iterator[None]:
    """A test marked `alone` waits until no other in real time runs, in whatever process, and none begins beside it."""
    if request.node.get_closest_marker("real_time") is None:
        yield
        return
    alone = request.node.get_closest_marker("alone") is not None
    door, room = (Path(tempfile.gettempdir()) / f"asvhil-tests-{os.getuid()}-{name}" for name in ("door", "room"))
    with locked(door, fcntl.LOCK_EX):  # whoever waits for the room keeps later ones out of it
        inside = locked(room, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        inside.__enter__()
    try:
        yield
    finally:
        inside.__exit__(None, None, None)
