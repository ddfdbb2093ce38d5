"""Writes the package of a new method or task from a template."""

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from tasks.files import whole_folder


def taken_names() -> list[str]:
    """Returns the names that a new method or task cannot have, since they mean something else."""
    from bench.guest_tasks import names_beside_tasks
    from tasks.registry import task_names

    return [*task_names(), *names_beside_tasks()]


def write_package(template: str, name: str, target: Path) -> None:
    """Writes a package to a new folder.

    Args:
        template: package that holds the template: files that end in ``.txt``, with ``NAME`` in
            their names, and ``{{name}}`` and ``{{Class}}`` in their text.
        name: of the method or task.
        target: the new folder.

    Raises:
        InputError: the folder exists or cannot be created.
    """
    class_name = "".join(part.capitalize() for part in name.split("_"))
    with whole_folder(target) as temporary:
        _copy(files(template), temporary, {"{{name}}": name, "{{Class}}": class_name}, name)


def _copy(source: Traversable, target: Path, words: dict[str, str], name: str) -> None:
    for one in source.iterdir():
        place = target / one.name.removesuffix(".txt").replace("NAME", name)
        if one.name.endswith(".txt"):
            text = one.read_text()
            for word, meaning in words.items():
                text = text.replace(word, meaning)
            place.write_text(text)
        elif one.is_dir() and one.name == "NAME":
            place.mkdir()
            _copy(one, place, words, name)
