"""Imported before every test: the package keeps NumPy to one thread, which must be said before NumPy is imported."""

from collections.abc import Iterator

import pytest

import asvhil
from asvhil.config.plugins import unload_all

assert asvhil.__version__


@pytest.fixture(autouse=True)
def own_plugins() -> Iterator[None]:
    """The plug-ins of a test are not those of the next."""
    yield
    unload_all()
