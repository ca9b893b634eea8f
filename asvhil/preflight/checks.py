"""What a survey found, judged: pass, warn or fail, with what to do."""

from __future__ import annotations

from asvhil.preflight.link_checks import clock_checks, rate_checks
from asvhil.preflight.parameter_checks import parameter_checks, wiring_checks
from asvhil.preflight.sensor_checks import sensor_checks
from asvhil.preflight.survey import Survey
from asvhil.preflight.table import Check
from asvhil.preflight.vehicle_checks import vehicle_checks


def checks_of(survey: Survey) -> list[Check]:
    """All that the links have told. The survey must be done."""
    return [
        *vehicle_checks(survey),
        *clock_checks(survey),
        *wiring_checks(survey),
        *parameter_checks(survey.findings),
        *rate_checks(survey),
        *sensor_checks(survey),
    ]
