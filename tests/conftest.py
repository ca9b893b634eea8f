"""Imported before every test: the package keeps NumPy to one thread, which must be said before NumPy is imported."""

from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

import asvhil
from asvhil.config.plugins import unload_all

assert asvhil.__version__

# Neither what an example takes nor how fast examples are drawn may decide a test: a busy machine is slow at both.
settings.register_profile("any load", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any load")


@pytest.fixture(autouse=True)
def own_plugins() -> Iterator[None]:
    """The plug-ins of a test are not those of the next."""
    yield
    unload_all()
