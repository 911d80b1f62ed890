"""What the documentation shows runs, and what the stubs say is there."""

import ast
import doctest
import importlib
import importlib.util
import os
import re
import subprocess
from itertools import count
from pathlib import Path
from typing import NamedTuple

import prehend
import pytest

ROOT = Path(__file__).parents[2]
REPOSITORY = re.compile(r"https://github\.com/prehend/prehend/(?:blob|tree)/main/")
GUIDE = ROOT / "docs" / "guide"
CHAPTERS = sorted(path for path in GUIDE.glob("*.md") if path.name != "README.md")

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


class Block(NamedTuple):
    """A fenced block of a page."""

    language: str
    text: str
    line: int
    file: str | None
    """What a reader saves it as, if the comment before it names a file: `file: NAME`."""


def blocks_of(path):
    pattern = r"(?:^<!-- file: (?P<file>\S+) -->\n)?^```(?P<language>[^\n]*)\n(?P<text>.*?)^```$"
    page = path.read_text()
    for found in re.finditer(pattern, page, re.DOTALL | re.MULTILINE):
        line = page.count("\n", 0, found.start("text"))
        yield Block(found["language"], found["text"], line, found["file"])


def test_the_readme_runs(capsys):
    blocks = [block for block in blocks_of(ROOT / "python" / "README.md") if block.language.startswith("python")]
    assert len(blocks) == 3
    names = {}
    for block in blocks:
        # A block may need a package: ```python jax.
        if all(importlib.util.find_spec(package) for package in block.language.split()[1:]):
            exec(block.text, names)
            assert capsys.readouterr().out


@pytest.mark.parametrize("path", CHAPTERS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore:a contact law in Python is slow")
def test_a_chapter_of_the_guide_runs(path, tmp_path, monkeypatch):
    """Blocks of a chapter one after the other, in a folder that is empty at first, in one Python."""
    blocks = list(blocks_of(path))
    command = os.environ.get("PREHEND_COMMAND")
    if command is None and any(block.language == "sh" for block in blocks):
        pytest.skip("PREHEND_COMMAND, the command prehend of the same build, is not set")
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    if command is not None:
        programs = tmp_path / "bin"
        programs.mkdir()
        (programs / "prehend").symlink_to(Path(command).resolve())
        monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PREHEND_CACHE", str(tmp_path / "cache"))
    names = {}
    for block in blocks:
        if block.file is not None:
            (work / block.file).write_text(block.text)
        elif block.language == "sh":
            shell = ["bash", "-euo", "pipefail", "-c", block.text]
            run = subprocess.run(shell, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            assert run.returncode == 0, f"{path.name}, line {block.line}:\n{run.stdout}"
        elif block.language == "python":
            # Line numbers of an error are those of the page.
            exec(compile("\n" * block.line + block.text, str(path), "exec"), names)
        else:
            # Others are not to be run, or, in Rust, tests of cargo.
            assert block.language.split(",")[0] in {"rust", "toml", "text", "math"}, block


def prose(path):
    """A page without its code."""
    fences = re.sub(r"^```.*?^```$", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"`[^`\n]*`", lambda code: re.sub(r"[\[\]()]", "", code[0]), fences)


def anchors_of(path):
    """The anchors of the headings of a page, as GitHub makes them."""
    text = re.sub(r"^```.*?^```$", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    anchors = set()
    for heading in re.findall(r"^#{1,6} +(.*?) *$", text, re.MULTILINE):
        shown = re.sub(r"!?\[([^\]]*)\](?:\([^)]*\)|\[[^\]]*\])", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-")
        numbered = (slug if n == 0 else f"{slug}-{n}" for n in count())
        anchors.add(next(anchor for anchor in numbered if anchor not in anchors))
    return anchors


def pages():
    """All pages of the repository."""
    for folder, folders, files in os.walk(ROOT):
        folders[:] = [name for name in folders if not name.startswith(".") and name not in {"target", "shared"}]
        yield from (Path(folder, name) for name in files if name.endswith(".md"))


def definitions(text):
    return {label.lower(): target for label, target in re.findall(r"^\[([^\]^]+)\]: +(\S+)$", text, re.MULTILINE)}


@pytest.mark.parametrize("path", sorted(pages()), ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path):
    """Files and headings that pages of the repository link to are there; other servers are not asked."""
    text = prose(path)
    labels = definitions(text)
    text = re.sub(r"^\[[^\]^]+\]: .*$", "", text, flags=re.MULTILINE)
    used = [label.lower() for label in re.findall(r"\]\[([^\]]+)\]", text)]
    used += [label.lower() for label in re.findall(r"(?<!\])\[([^\]]+)\](?![\[(:])", text) if label.lower() in labels]
    assert set(used) <= set(labels), set(used) - set(labels)
    targets = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r"(?:src|href)=\"([^\"]+)\"", text)
    for target in [*targets, *labels.values()]:
        place, _, anchor = target.partition("#")
        if own := REPOSITORY.match(place):
            linked = ROOT / place[own.end() :].removesuffix("?raw=true")
        elif re.match(r"\w+:", place):
            continue
        else:
            linked = path.parent / place if place else path
        assert linked.exists(), target
        if anchor and linked.suffix == ".md":
            assert anchor in anchors_of(linked), target


@pytest.mark.parametrize("path", [GUIDE / "README.md", *CHAPTERS], ids=lambda path: path.stem)
def test_links_of_the_guide_lead_somewhere_in_rustdoc_too(path):
    """A chapter is a page of rustdoc, too, for which guide_links.md defines its links anew."""
    inline = re.findall(r"\]\(([^)\s]+)\)", prose(path))
    assert all(re.match(r"https?:|#", target) for target in inline), inline
    anew = definitions((ROOT / "src" / "guide_links.md").read_text())
    for label, target in definitions(prose(path)).items():
        place, _, anchor = target.partition("#")
        if own := REPOSITORY.match(anew[label]):
            linked = ROOT / anew[label][own.end() :].partition("#")[0].removesuffix("?raw=true")
            assert linked == (GUIDE / place).resolve() and anew[label].partition("#")[2] == anchor, label
        elif place in {chapter.name for chapter in CHAPTERS}:
            assert anew[label] == f"crate::guide::{place.removesuffix('.md').replace('-', '_')}"
        else:
            # Of Rust, which rustdoc checks.
            assert "::" in anew[label], label


def test_the_guide_lists_its_chapters():
    index = (GUIDE / "README.md").read_text()
    listed = [definitions(index)[label] for label in re.findall(r"^\| \[[^\]]+\]\[([^\]]+)\] \|", index, re.MULTILINE)]
    assert sorted(listed) == [path.name for path in CHAPTERS]
    assert re.findall(r"^chapter!\(\w+, \"(\S+)\"\)", (ROOT / "src" / "guide.rs").read_text(), re.MULTILINE) == listed
