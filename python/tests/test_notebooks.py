"""The notebooks run to their end; each has assertions."""

import importlib.util
from pathlib import Path

import pytest

NEEDS = {
    "arm": ["matplotlib"],
    "gymnasium_environment": ["matplotlib", "gymnasium", "torch"],
    "learn_friction_with_jax": ["matplotlib", "jax", "optax"],
    "refine_a_frame": ["matplotlib"],
    "throw_through_a_bounce": ["matplotlib", "torch"],
    "track_a_film": ["matplotlib"],
}
FOLDER = Path(__file__).parents[1] / "notebooks"


def test_each_notebook_is_listed():
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(NEEDS)


@pytest.mark.parametrize("name", NEEDS)
def test_notebook(name, tmp_path):
    for module in ["nbclient", "ipykernel", *NEEDS[name]]:
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"{module} is not installed")
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=300, resources=resources).execute()
