"""Runs the code cells of a notebook in order, in its folder, and compares their outputs with those stored in it.

Texts have to be equal; of figures and tables in HTML only their presence is compared.
Usage: python3 notebook.py [--update] NOTEBOOK. With --update the outputs are stored in the notebook instead.
Needs no Jupyter: the value of a cell's last expression is shown by its `_repr_svg_`, `_repr_html_` and `repr`, as there.
"""

import ast
import base64
import contextlib
import io
import json
import os
import sys
from pathlib import Path

#: Largest notebook with its outputs, in bytes.
MAX_BYTES = 300_000


def lines(text):
    """Text as the list of lines that notebooks store."""
    return text.splitlines(keepends=True)


def shown(value):
    """Stored forms of a value by their type, as a notebook shows it."""
    data = {"text/plain": lines(repr(value))}
    for name, kind in (("_repr_svg_", "image/svg+xml"), ("_repr_html_", "text/html")):
        form = getattr(value, name, lambda: None)()
        if form is not None:
            data[kind] = lines(form)
    return data


def plots():
    """Outputs for the open figures of pyplot, which are closed, as notebooks show them at the end of a cell."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    outputs = []
    for number in pyplot.get_fignums() if pyplot else []:
        figure = pyplot.figure(number)
        image = io.BytesIO()
        figure.savefig(image, format="png", dpi=80, bbox_inches="tight")
        data = {"image/png": base64.b64encode(image.getvalue()).decode(), "text/plain": lines(repr(figure))}
        outputs.append({"data": data, "metadata": {}, "output_type": "display_data"})
        pyplot.close(figure)
    return outputs


def execute(source, names):
    """Outputs of a code cell, whose names are added to `names`."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "<cell>", "exec"), names)
        value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names) if last else None
    outputs = []
    if printed.getvalue():
        outputs.append({"name": "stdout", "output_type": "stream", "text": lines(printed.getvalue())})
    if value is not None:
        outputs.append({"data": shown(value), "metadata": {}, "output_type": "execute_result"})
    return outputs + plots()


def compared(outputs):
    """The part of a cell's outputs that has to be equal: texts, and the types of everything else."""
    parts = []
    for output in outputs:
        if output["output_type"] == "stream":
            parts.append(output["text"])
        else:
            # The text of a matplotlib figure has its size, which depends on the version.
            has_image = "image/png" in output["data"]
            parts.append([None if has_image else output["data"]["text/plain"], sorted(output["data"])])
    return parts


def main(arguments):
    update = "--update" in arguments
    path = Path(next(argument for argument in arguments if not argument.startswith("--"))).resolve()
    notebook = json.loads(path.read_text(encoding="utf-8"))
    os.chdir(path.parent)
    # Figures are drawn without a display.
    os.environ["MPLBACKEND"] = "agg"
    names = {"__name__": "__main__"}
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    problems = []
    for number, cell in enumerate(cells, 1):
        source = "".join(cell["source"])
        outputs = execute(source, names)
        if update:
            for output in outputs:
                if output["output_type"] == "execute_result":
                    output["execution_count"] = number
            cell["outputs"], cell["execution_count"] = outputs, number
        elif compared(outputs) != compared(cell["outputs"]):
            stored, found = (json.dumps(compared(of), indent=1) for of in (cell["outputs"], outputs))
            problems.append(f"cell {number}:\n{source}\nstored: {stored}\nfound: {found}")
    if update:
        path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    if path.stat().st_size > MAX_BYTES:
        problems.append(f"the notebook has {path.stat().st_size} bytes, more than {MAX_BYTES}")
    if not cells:
        problems.append("the notebook has no code cell")
    if problems:
        sys.exit(f"{path}: " + "\n".join(problems))
    print(f"{path.name}: {len(cells)} cells, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main(sys.argv[1:])
