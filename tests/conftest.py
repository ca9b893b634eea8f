"""Imported before every test: the package keeps NumPy to one thread, which must be said before NumPy is imported."""

import asvhil

assert asvhil.__version__
