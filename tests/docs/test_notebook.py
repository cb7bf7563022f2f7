"""docs/notebook.ipynb runs from its first cell to its last, and says what it says there."""

import sys

import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpec, KernelSpecManager
from nbclient import NotebookClient
from nbformat import NotebookNode

from tests.docs.documents import DOCS


class OwnKernel(KernelSpecManager):
    """This very Python, whatever kernels the user has."""

    def get_kernel_spec(self, kernel_name: str) -> KernelSpec:
        del kernel_name
        argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        return KernelSpec(argv=argv, display_name="Python 3", language="python")


def outputs(notebook: NotebookNode) -> str:
    """All that its cells said."""
    found = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    return "".join(output.get("text") or str(output.get("data", {})) for output in found)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of the client's own
def test_the_notebook_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    notebook = nbformat.read(DOCS / "notebook.ipynb", as_version=4)
    client = NotebookClient(notebook, timeout=120)
    client.create_kernel_manager()
    assert client.km is not None
    client.km.kernel_spec_manager = OwnKernel()
    client.execute()
    said = outputs(notebook)
    assert "9 of 9 localized" in said
    assert said.count("image/png") == 2
    assert "different" in said
