"""Values of config fields, checked against the types that the fields declare."""

import json
from types import UnionType
from typing import Any, Union, get_args, get_origin

from bench.parsing import scalar
from tasks.errors import InputError


def fits_type(value: Any, hint: Any) -> bool:
    """Whether a value has the type that a field declares."""
    if get_origin(hint) in (Union, UnionType):
        return any(fits_type(value, option) for option in get_args(hint))
    if get_origin(hint) is tuple:
        if not isinstance(value, list | tuple):
            return False
        inner = _inner(hint, len(value))
        return len(value) == len(inner) and all(map(fits_type, value, inner))
    if isinstance(value, bool) or hint is bool:
        return isinstance(value, bool) and hint is bool
    if hint is float:
        return isinstance(value, int | float) and -1e300 < value < 1e300  # and so not NaN
    return isinstance(value, hint)


def typed(value: Any, hint: Any) -> Any:
    """Returns a value, converted to the type that a field declares if possible.

    A tuple may be written as ``64,32``, ``(64, 32)`` or ``[64, 32]``; 1 becomes 1.0 in a field of
    floats, and 1e3 becomes 1000 in a field of integers.
    """
    options = _options(hint)
    tuples = [option for option in options if get_origin(option) is tuple]
    if tuples and isinstance(value, str) and str not in options and "," in value:
        parts = value.strip().strip("()[]").split(",")
        value = [scalar(part) for part in parts if part.strip()]
    if tuples and isinstance(value, list | tuple):
        inner = _inner(tuples[0], len(value))
        return tuple(map(typed, value, inner)) if len(value) == len(inner) else tuple(value)
    if float in options and int not in options and fits_type(value, float):
        return float(value)
    if int in options and float not in options and isinstance(value, float) and value.is_integer():
        return int(value)
    return tuple(value) if isinstance(value, list) else value  # configs hold tuples


def _inner(hint: Any, count: int) -> tuple[Any, ...]:
    """The type of each of a tuple's values; of so many, if any number is allowed."""
    inner = get_args(hint)
    return inner[:1] * count if inner[-1] is Ellipsis else inner


def _options(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)


def several(value: Any, hint: Any) -> list[Any]:
    """Returns the values that a setting stands for: one, or each of a list for a plain field.

    A list is written as ``16,64,128`` or given as a list. A value that does not fit stays alone.
    """
    one = typed(value, hint)
    options = _options(hint)
    if fits_type(one, hint) or any(get_origin(option) is tuple for option in options):
        return [one]
    listed = value.split(",") if isinstance(value, str) and "," in value else value
    if not isinstance(listed, list | tuple) or not listed:
        return [one]
    return [typed(scalar(part) if isinstance(part, str) else part, hint) for part in listed]


def wrong_type(place: str, hint: Any, value: Any, default: Any) -> InputError:
    """Returns the error for a value of another type than its field declares.

    Args:
        place: the field, ``METHOD.FIELD``.
        hint: the type that the field declares.
        value: the value given.
        default: the default value of the field, shown as an example.
    """
    shown = hint.__name__ if isinstance(hint, type) and not get_args(hint) else hint
    if isinstance(default, list | tuple):
        example = ",".join(map(json.dumps, default)) + "," * (len(default) == 1)
    else:
        example = json.dumps(default)
    return InputError(f"{place} takes {shown}, got {value!r}; for example --set {place}={example}")
