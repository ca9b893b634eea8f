"""The kinds of values a config is made of, and what every section of it has in common."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from asvhil.errors import ConfigError
from asvhil.io.endpoints.spec import parse_spec

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Degrees = Annotated[float, Field(ge=-360.0, le=360.0)]
Latitude = Annotated[float, Field(ge=-90.0, le=90.0)]
Longitude = Annotated[float, Field(ge=-180.0, le=180.0)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
ServoUs = Annotated[int, Field(ge=500, le=2500)]
MavlinkId = Annotated[int, Field(ge=1, le=255)]


def _checked_link(spec: str) -> str:
    try:
        parse_spec(spec)
    except ConfigError as error:
        raise ValueError(str(error)) from None
    return spec


LinkSpecText = Annotated[str, AfterValidator(_checked_link)]


class Section(BaseModel):
    """A part of the config: unknown keys are refused and nothing changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
