"""No module imports what imports it."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import weighbridge

ROOT = Path(weighbridge.__file__).parent


def modules():
    """Every module of the package: dotted name, path and syntax tree."""
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT.parent).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        yield name, path, ast.parse(path.read_text(encoding="utf-8"))


def imported(tree, known):
    """Modules that a tree imports, at run time or for its types."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module in known:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield full if full in known else node.module


def test_no_module_imports_what_imports_it():
    trees = {name: tree for name, _, tree in modules()}
    graph = {name: set(imported(tree, trees)) - {name} for name, tree in trees.items()}
    assert any(graph.values())
    TopologicalSorter(graph).prepare()


def test_a_circle_is_seen():
    here = ast.parse("if TYPE_CHECKING:\n    from a.b import C\nfrom a import d\n")
    assert set(imported(here, {"a", "a.b", "a.d"})) == {"a.b", "a.d"}
    with pytest.raises(ValueError, match="cycle"):
        TopologicalSorter({"a": {"b"}, "b": {"a"}}).prepare()
