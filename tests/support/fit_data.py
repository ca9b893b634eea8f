"""The data that the tests of training share."""

from tests.support.model_data import training_set

DATA = training_set(1, duration_s=120.0, winds_mps=(3.0, 6.0))
