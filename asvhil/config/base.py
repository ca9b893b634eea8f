"""Value types of config keys with their ranges, and the base class of all sections."""

from __future__ import annotations

import hashlib
import json
from typing import Annotated, Any, ClassVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    model_serializer,
    model_validator,
)
from pydantic_core import CoreSchema

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


def known_only(info: ValidationInfo) -> bool:
    """Whether a config of a log is read for what was measured alone: names that are not known here then pass."""
    return bool(info.context and info.context.get("known_only"))


def is_stored(info: ValidationInfo) -> bool:
    """Whether a config is read back from a log, where all of its keys are written out."""
    return bool(info.context and info.context.get("stored"))


def _checked_link(spec: str, info: ValidationInfo) -> str:
    try:
        if not known_only(info):
            parse_spec(spec)
    except ConfigError as error:
        raise ValueError(str(error)) from None
    return spec


LinkSpecText = Annotated[str, AfterValidator(_checked_link)]


def _typed(schema: Any) -> Any:
    """The schema with text no longer taken for a number or a truth: `on`, '5', 1_000 and 1:30 are text in YAML 1.2."""
    if isinstance(schema, dict):
        typed = {key: value if key == "serialization" else _typed(value) for key, value in schema.items()}
        return typed | {"strict": True} if schema.get("type") in ("bool", "int", "float") else typed
    return [_typed(part) for part in schema] if type(schema) is list else schema


class Section(BaseModel):
    """Base of all sections: frozen; unknown keys, infinities, NaN and text for a number or truth are refused.

    Every key has a description.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    # Keys that came later, so that a config without them keeps the hash that it has always had.
    left_out_if_empty: ClassVar[tuple[str, ...]] = ()
    # Keys that came later and whose default changes what a program does: what one did that wrote a log without them.
    before_it_came: ClassVar[tuple[tuple[str, Any], ...]] = ()

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        typed: CoreSchema = _typed(handler(source))
        return typed

    @model_serializer(mode="wrap")
    def _without_empty(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        tree: dict[str, Any] = handler(self)
        return {key: value for key, value in tree.items() if value or key not in self.left_out_if_empty}

    @model_validator(mode="before")
    @classmethod
    def _over_defaults(cls, data: Any, info: ValidationInfo) -> Any:
        """Fill the keys that a config leaves out from the default of this place, not from that of the section's class.

        `mpc.near` and `mpc.along` are of one class with defaults of their own: setting one weight keeps the others.
        """
        if not isinstance(data, dict):
            return data
        if info.context is not None and info.context.get("stored"):
            data = dict(cls.before_it_came) | data
        defaults = {name: cls.model_fields[name].default for name in data if name in cls.model_fields}
        return {
            name: {**defaults[name].model_dump(exclude_unset=True), **value}
            if isinstance(value, dict) and isinstance(defaults.get(name), Section)
            else value
            for name, value in data.items()
        }

    def content_hash(self) -> str:
        """First 16 hexadecimal digits of the SHA-256 of `canonical_json`; logs and model files name a config by it."""
        return hashlib.sha256(self.canonical_json().encode()).hexdigest()[:16]

    def canonical_json(self) -> str:
        """The section as JSON with sorted keys; `config_from_json` reads an equal config back."""
        return json.dumps(self.model_dump(mode="json"), sort_keys=True)
