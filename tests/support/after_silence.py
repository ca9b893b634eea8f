"""Measured on a real ArduRover 4.6.3: the motors after the sender of the overrides was killed."""

from __future__ import annotations

from asvhil.types import Radio

ABSENT, HEARD, LOST = Radio.ABSENT, Radio.HEARD, Radio.LOST

# (radio, what is not at its default, seconds until neutral outputs; None: they still ran after 12 s)
MEASURED: tuple[tuple[Radio, dict[str, float], float | None], ...] = (
    (ABSENT, {}, 0.5),
    (ABSENT, {"FS_THR_ENABLE": 2}, 0.5),
    (ABSENT, {"FS_ACTION": 0}, 0.5),
    (ABSENT, {"FS_ACTION": 5}, 0.5),
    (ABSENT, {"RC_OVERRIDE_TIME": -1}, 0.5),
    (ABSENT, {"RC_OVERRIDE_TIME": 10}, 0.5),
    (ABSENT, {"FS_THR_ENABLE": 0}, None),
    (ABSENT, {"FS_THR_ENABLE": 0, "RC_OVERRIDE_TIME": 0.5}, None),
    (ABSENT, {"FS_THR_ENABLE": 0, "FS_GCS_ENABLE": 1}, 6.6),
    (ABSENT, {"FS_THR_ENABLE": 0, "FS_GCS_ENABLE": 1, "FS_ACTION": 0}, None),
    (HEARD, {}, 3.0),
    (HEARD, {"FS_ACTION": 0}, 3.0),
    (HEARD, {"RC_OVERRIDE_TIME": 1}, 1.1),
    (HEARD, {"RC_OVERRIDE_TIME": 10}, 10.1),
    (HEARD, {"FS_THR_ENABLE": 0}, 3.1),
    (HEARD, {"RC_OVERRIDE_TIME": -1}, None),
    (HEARD, {"RC_OVERRIDE_TIME": -1, "FS_THR_ENABLE": 0}, None),
    (HEARD, {"RC_OVERRIDE_TIME": -1, "FS_GCS_ENABLE": 1}, 6.6),
    (HEARD, {"RC_OVERRIDE_TIME": -1, "FS_GCS_ENABLE": 1, "FS_ACTION": 0}, 6.6),
    (HEARD, {"RC_OPTIONS": 33}, 3.5),
    (HEARD, {"RC_OPTIONS": 33, "FS_THR_ENABLE": 0}, None),
    (LOST, {}, 0.6),
    (LOST, {"RC_OVERRIDE_TIME": -1}, 0.6),
    (LOST, {"FS_THR_ENABLE": 0}, None),
)
