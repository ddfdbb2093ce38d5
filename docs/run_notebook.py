"""Writes what the cells of notebooks show into them: ``python docs/run_notebook.py FILE...``.

A cell shows the figures it has drawn, and the value of its last line unless that ends in ``;``.
"""

import ast
import base64
import io
import json
import os
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt

DPI = 64


def run_notebook(path: Path) -> tuple[str, dict[str, Any]]:
    """Returns the text of a notebook with its outputs, and the names that its cells have made.

    Cells run in the folder of the notebook, and in one name space.
    """
    notebook, names = json.loads(path.read_text()), dict[str, Any]()
    before = Path.cwd()
    os.chdir(path.absolute().parent)
    try:
        with mpl.rc_context({"backend": "agg"}):
            cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
            for count, cell in enumerate(cells, start=1):
                cell["execution_count"] = count
                cell["outputs"] = _outputs("".join(cell["source"]), count, names)
    finally:
        os.chdir(before)
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", names


def _outputs(source: str, count: int, names: dict[str, Any]) -> list[dict[str, Any]]:
    code = ast.parse(source)
    last = code.body.pop() if isinstance(code.body[-1], ast.Expr) else None
    exec(compile(code, f"cell {count}", "exec"), names)
    value = (
        eval(compile(ast.Expression(last.value), f"cell {count}", "eval"), names) if last else None
    )
    shown = []
    if value is not None and not source.rstrip().endswith(";"):
        data = {"text/plain": repr(value).splitlines(keepends=True)}
        if hasattr(value, "_repr_html_"):
            data["text/html"] = value._repr_html_().splitlines(keepends=True)
        shown.append(
            {
                "output_type": "execute_result",
                "execution_count": count,
                "metadata": {},
                "data": data,
            }
        )
    for number in plt.get_fignums():
        shown.append({"output_type": "display_data", "metadata": {}, "data": _picture(number)})
    plt.close("all")
    return shown


def _picture(number: int) -> dict[str, Any]:
    file = io.BytesIO()
    plt.figure(number).savefig(file, dpi=DPI, bbox_inches="tight", metadata={"Software": None})
    encoded = base64.b64encode(file.getvalue()).decode()
    return {"image/png": encoded + "\n", "text/plain": ["<Figure>"]}


if __name__ == "__main__":
    for path in map(Path, sys.argv[1:]):
        path.write_text(run_notebook(path)[0])
