"""asvhil: a hardware-in-the-loop MAVLink bridge for station keeping of small autonomous surface vehicles."""

import os

# The matrices here are small: threads that NumPy would start for them only take the cores from the loop, and make a
# factorisation of half a millisecond last fifty where another process is busy. Set before NumPy is first imported.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

__version__ = "0.1.0"
