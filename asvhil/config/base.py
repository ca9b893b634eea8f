"""The kinds of values a config is made of, and what every section of it has in common."""

from __future__ import annotations

import hashlib
import json
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from asvhil.config.link_spec import parse_spec
from asvhil.errors import ConfigError

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

    @model_validator(mode="before")
    @classmethod
    def _over_defaults(cls, data: Any) -> Any:
        """Keys of a section that a config leaves out are those of this place's own default, not of the section's kind.

        `mpc.near` and `mpc.along` are of one kind and have defaults of their own: setting one weight keeps the others.
        """
        if not isinstance(data, dict):
            return data
        defaults = {name: cls.model_fields[name].default for name in data if name in cls.model_fields}
        return {
            name: {**defaults[name].model_dump(exclude_unset=True), **value}
            if isinstance(value, dict) and isinstance(defaults.get(name), Section)
            else value
            for name, value in data.items()
        }

    def content_hash(self) -> str:
        """First 16 hex digits of the SHA-256 of it in canonical JSON."""
        return hashlib.sha256(self.canonical_json().encode()).hexdigest()[:16]

    def canonical_json(self) -> str:
        """All of it as JSON with sorted keys, of which an equal one can be read back."""
        return json.dumps(self.model_dump(mode="json"), sort_keys=True)
