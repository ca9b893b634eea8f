"""Keys that choose a registered kind by name, and sections that hold the settings of kinds beside their own keys."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import CoreSchema, InitErrorDetails, core_schema

from asvhil.config.base import Section, known_only
from asvhil.config.registry import Registry


@dataclasses.dataclass(frozen=True)
class NamedIn:
    """Annotation of a key that holds the name of a registered kind."""

    registry: Registry[Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def check(name: str, info: ValidationInfo) -> str:
            return name if known_only(info) else self.registry.checked(name)

        return core_schema.with_info_after_validator_function(check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(schema), "enum": self.registry.own_names()}


class Choosing(Section):
    """Keys that are no fields are sections of registered kinds, each checked by the model that its kind names.

    The chosen kind's own section is there even where the config leaves it out, so that a log holds every setting.
    """

    model_config = ConfigDict(extra="allow")

    registry: ClassVar[Registry[Any]]
    chooser: ClassVar[str]  # the field with the chosen name

    @property
    def settings(self) -> Any:
        """The chosen kind's own section; None where it has none. ConfigError where the kind is not known."""
        kind = self.registry.find(getattr(self, self.chooser))
        if kind.section is None:
            return None
        return getattr(self, kind.settings_key, None) or kind.section()

    @model_validator(mode="before")
    @classmethod
    def _with_sections(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict):
            return data
        name = data.get(cls.chooser, cls.model_fields[cls.chooser].default)
        kind = cls.registry.get(name) if isinstance(name, str) else None
        if kind is None and not known_only(info):
            return data  # its own settings cannot be known either: the name is what is wrong
        unknown = [key for key in data if key not in cls.model_fields and cls._kind_of(key) is None]
        if unknown:
            lines = [InitErrorDetails(type="extra_forbidden", loc=(key,), input=data[key]) for key in unknown]
            raise ValidationError.from_exception_data(cls.__name__, lines)
        tree = {key: value if key in cls.model_fields else cls._section(key, value) for key, value in data.items()}
        if kind is not None and kind.section is not None:
            field = cls.model_fields.get(kind.settings_key)
            if field is None:
                tree.setdefault(kind.settings_key, cls._section(kind.settings_key, {}))
            elif field.annotation is not kind.section:
                key = kind.settings_key
                raise ValueError(f"the settings of {name} are under {key}, which is taken: its kind needs another key")
        return tree

    @classmethod
    def _kind_of(cls, key: Any) -> Any:
        return cls.registry.at_key(key) if isinstance(key, str) else None

    @classmethod
    def _section(cls, key: Any, value: Any) -> BaseModel:
        """The settings of a registered kind."""
        kind = cls._kind_of(key)
        # As a part of a mapping, so that an error tells the key of the section too.
        return TypeAdapter(dict[str, kind.section]).validate_python({key: value})[key]  # type: ignore[no-any-return,name-defined]
