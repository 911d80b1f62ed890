"""What the documentation shows runs, and what the stubs say is there."""

import ast
import doctest
import importlib
import importlib.util
from pathlib import Path

import prehend
import pytest

MODULES = {
    "prehend.pullback": None,
    "prehend.laws": None,
    "prehend.refinement": None,
    "prehend.torch": "torch",
    "prehend.torch_render": "torch",
    "prehend.jax": "jax",
    "prehend.jax_render": "jax",
}


@pytest.mark.parametrize(("module", "needs"), MODULES.items())
def test_docstrings_run(module, needs):
    if needs is not None:
        pytest.importorskip(needs)
    results = doctest.testmod(importlib.import_module(module))
    assert results.attempted > 0 and results.failed == 0


def test_stubs_and_the_module_have_the_same_names():
    module = importlib.import_module("prehend._prehend")
    stub = ast.parse(Path(prehend.__file__).with_name("_prehend.pyi").read_text())
    for node in stub.body:
        if isinstance(node, ast.ClassDef):
            own = getattr(module, node.name)
            stubbed = {f.name for f in node.body if isinstance(f, ast.FunctionDef)}
            there = {name for name in vars(own) if not name.startswith("_")}
            public = {name for name in stubbed if not name.startswith("_")}
            assert public == there, node.name
            assert own.__doc__ or node.name == "Error"
            undocumented = [name for name in there if not getattr(own, name).__doc__]
            assert not undocumented, (node.name, undocumented)
    names = [n.name for n in stub.body if isinstance(n, ast.FunctionDef | ast.ClassDef)]
    functions = {name for name in names if not name.startswith("_")}
    there = {name for name in vars(module) if not name.startswith("_")}
    assert functions == there


def test_mypy_in_strict_mode(tmp_path):
    if importlib.util.find_spec("mypy") is None:
        pytest.skip("mypy is not installed")
    from mypy import api

    example = Path(__file__).parents[1] / "examples" / "learn_friction.py"
    out, err, code = api.run(["--strict", "--cache-dir", str(tmp_path), str(example)])
    assert code == 0, out + err


def test_the_readme_runs(capsys):
    text = (Path(__file__).parents[1] / "README.md").read_text()
    blocks = [block.split("```")[0] for block in text.split("```python")[1:]]
    assert len(blocks) == 2
    for block in blocks:
        exec(block, {})
        assert capsys.readouterr().out
