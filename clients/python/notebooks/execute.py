"""Executes all notebooks. A notebook fails if one of its cells fails. The files stay as they are.

python execute.py
"""

import pathlib

import nbclient
import nbformat

for path in sorted(pathlib.Path(__file__).parent.glob("*.ipynb")):
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    shown = sum("text/html" in output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", []))
    assert shown, f"{path.name} shows no result"
    print(f"{path.name}: {len(notebook.cells)} cells, {shown} results")
