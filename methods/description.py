"""Describes a method in plain data, for processes that must not import it.

The process that plans a run never imports the code of a package. Another process describes the
method, and a stand-in with the same sizes and variants takes its place.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, make_dataclass
from types import NoneType, UnionType
from typing import Any, NoReturn, Union, get_args, get_origin, get_type_hints

from methods.base import (
    ActionMethod,
    Method,
    MotionMethod,
    config_of,
    fits_together,
    machine_fields,
)
from methods.contract import ContractError, from_json, resolved

_PLAIN = (bool, int, float, str, NoneType)


@dataclass(frozen=True)
class Description:
    """A method's class as plain data."""

    name: str
    summary: str
    version: int
    motions: bool
    """True for a MotionMethod, False for an ActionMethod."""
    together: bool
    """True if it overrides `fit_seeds`."""
    validates: bool
    """True if it uses validation demonstrations."""
    replans: bool
    """True if it predicts motions from any state."""
    sizes: Mapping[str, Mapping[str, Any]]
    """For each size, the config's values (`methods.contract.resolved`)."""
    default_size: Mapping[str, str]
    variants: Mapping[str, Mapping[str, Any]]
    hints: Mapping[str, Any]
    """For each field of the configs, its type; `object` if that is not plain data."""
    machine: Mapping[str, Any]
    """The defaults of the fields that say where it computes, see `methods.base.machine_fields`."""


def describe_method(method: type[Method]) -> Description:
    """Returns the description of a method.

    Raises:
        ContractError: the class lacks what a run needs to know, or a config cannot be stored.
    """
    if type(method.version) is not int:
        raise ContractError(f"version must be a whole number, got {method.version!r}")
    if not method.sizes:
        raise ContractError("sizes is empty: it needs at least one size")
    if "described" not in method.variants:
        raise ContractError("variants lacks 'described'")
    kinds = {type(config) for config in method.sizes.values()}
    if len(kinds) > 1:
        names = sorted(kind.__name__ for kind in kinds)
        raise ContractError(f"all sizes must have configs of one class, got {', '.join(names)}")
    for size, config in method.sizes.items():
        for variant, changes in method.variants.items():
            _check_config(size, config, variant, changes)
            _check_epochs(resolved(config_of(method, size, variant)))
            _check_machine(config_of(method, size, variant))
    (kind,) = kinds
    declared = get_type_hints(kind)
    return Description(
        name=str(method.name),
        summary=str(getattr(method, "summary", "")),
        version=method.version,
        motions=issubclass(method, MotionMethod),
        together=fits_together(method),
        validates=bool(method.validates),
        replans=bool(method.replans),
        sizes={size: resolved(config) for size, config in method.sizes.items()},
        default_size={str(task): str(size) for task, size in method.default_size.items()},
        variants={name: dict(changes) for name, changes in method.variants.items()},
        hints={f.name: _plain(declared[f.name]) for f in fields(kind) if f.init},
        machine={f.name: f.default for f in fields(kind) if f.name in machine_fields(kind)},
    )


def _check_config(size: str, config: Any, variant: str, changes: Mapping[str, Any]) -> None:
    """Raises ContractError unless a config is a frozen dataclass with the fields of a variant."""
    frozen = is_dataclass(config) and type(config).__setattr__ is not object.__setattr__
    if not frozen:
        raise ContractError(f"the config of size {size!r} is not a frozen dataclass")
    unknown = sorted(set(changes) - {field.name for field in fields(config)})
    if unknown:
        listed = ", ".join(map(repr, unknown))
        raise ContractError(f"variant {variant!r} sets {listed}, which size {size!r} lacks")


def _check_epochs(values: Mapping[str, Any]) -> None:
    epochs = values.get("epochs", 1)
    if type(epochs) is not int or epochs < 1:
        raise ContractError(f"a field called epochs is a whole number from 1, got {epochs!r}")


def _check_machine(config: Any) -> None:
    """Raises ContractError unless a field of the machine has its default in all configs."""
    for name in machine_fields(config):
        default = {one.name: one.default for one in fields(config)}[name]
        if getattr(config, name) != default:
            raise ContractError(
                f"the field {name!r} says where the method computes, so it needs a default that no"
                f" size and no variant changes, got {getattr(config, name)!r}"
            )


def _plain(hint: Any) -> Any:
    if get_origin(hint) in (Union, UnionType, tuple):
        parts = [part for part in get_args(hint) if part is not Ellipsis]
        return hint if all(_plain(part) is not object for part in parts) else object
    return hint if hint in _PLAIN else object


def stand_in(description: Description) -> type[Method]:
    """Returns a class with everything in a description, whose methods cannot be called."""
    machine = {
        name: field(default=default, metadata={"of_machine": True})
        for name, default in description.machine.items()
    }
    declared = [
        (name, kind, machine.get(name, field())) for name, kind in description.hints.items()
    ]
    config = make_dataclass("Config", declared, frozen=True, kw_only=True)
    base = MotionMethod if description.motions else ActionMethod
    said = {
        "name": description.name,
        "summary": description.summary,
        "version": description.version,
        "validates": description.validates,
        "replans": description.replans,
        "sizes": {size: from_json(config, v) for size, v in description.sizes.items()},
        "default_size": description.default_size,
        "variants": description.variants,
    }
    uncallable = [*base.__abstractmethods__, *["fit_seeds"] * description.together]
    return type(description.name, (base,), said | dict.fromkeys(uncallable, _refuse))


def _refuse(*arguments: Any, **options: Any) -> NoReturn:
    raise NotImplementedError("a stand-in cannot be called")
