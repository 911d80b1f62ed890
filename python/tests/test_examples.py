"""The examples run to their end; each has an assertion."""

import runpy
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_example(path):
    for module in ("jax", "optax", "torch"):
        if f"import {module}" in path.read_text():
            pytest.importorskip(module)
    runpy.run_path(str(path), run_name="__main__")
