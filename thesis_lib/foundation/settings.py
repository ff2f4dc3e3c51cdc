"""Base class of all typed sections of YAML files: unknown keys are refused, checked values are immutable."""

from collections.abc import Mapping
from typing import Any, dataclass_transform

from pydantic import BaseModel, ConfigDict


@dataclass_transform(kw_only_default=True, field_specifiers=())
class SectionType(type(BaseModel)):
    """Metaclass for type checkers: a value assigned to a field is its default, also in `Field(0.3, ge=0.0)`."""


class Section(BaseModel, metaclass=SectionType):
    """A section of dataset.yaml or of the configuration."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def merged(base: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The mapping `base` with the keys of `values` added or replaced, section by section."""
    both = [key for key in values if isinstance(values[key], dict) and isinstance(base.get(key), dict)]
    return {**base, **values, **{key: merged(base[key], values[key]) for key in both}}
