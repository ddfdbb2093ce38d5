"""Whether a submitted row must have the same bits here: same package, kernels and versions."""

from collections.abc import Iterator, Mapping
from typing import Any

from bench.checking import known
from bench.package_source import package_source
from bench.provenance import same_bits, software
from bench.submission import Submission
from methods.registry import package_methods
from tasks.errors import InputError
from tasks.pins import UNPINNED


def check_repeatable(row: Submission) -> None:
    """Checks that this installation must compute what a submitted row holds, bit by bit.

    Raises:
        InputError: the method's package is not installed, or with another source; or the row was
            computed with other software, or unpinned kernels.
    """
    name, origin = row.path.name, row.origin
    package = f"the package {origin.package.name} {origin.package.version}"
    if origin.method not in package_methods():
        raise InputError(f"{name} is a row of {package}: install it to repeat the row")
    here = package_source(origin.method)
    different = origin.package.difference(here)
    if different:
        raise InputError(
            f"{name} is a row of {package}, and another source is installed ({here.name}"
            f" {here.version}): {different} differs; install the submitted source"
        )
    installed = known(origin.method).version
    if installed != origin.version:
        raise InputError(
            f"{name} says that {origin.method} has version {origin.version}, and {installed} is"
            " installed"
        )
    for folder in row.frame().folder.unique():
        facts = row.facts(folder)
        if not same_bits(facts, software()):
            found = "; ".join(_differences(facts, software()))
            raise InputError(f"{name} cannot be repeated bit by bit here: {found}")


def _differences(stored: Mapping[str, Any], here: Mapping[str, Any]) -> Iterator[str]:
    """Yields what of two sets of software differs."""
    if here["pins"] == UNPINNED:
        yield "kernels are not pinned, see bench doctor"
    flat = [
        {"kernels": facts.get("pins"), "C library": facts.get("c_library"), **facts["versions"]}
        for facts in (stored, here)
    ]
    for name in dict.fromkeys((*flat[0], *flat[1])):
        one, other = (facts.get(name) for facts in flat)
        if one != other:
            yield f"{name} {one} in the row, {other} here"
