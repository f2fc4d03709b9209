"""No module imports what imports it, and tests import no more of the inside than they say."""

import ast
import re
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import weighbridge

ROOT = Path(weighbridge.__file__).parent
TESTS = Path(__file__).parents[1]
GUIDE = TESTS.parent / "CONTRIBUTING.md"


def modules():
    """Path of every module of the package, by its dotted name."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def given(known):
    """Names that a room gives itself, although it has a module of that name."""
    for room, path in known.items():
        if path.name == "__init__.py":
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ImportFrom) and node.module in known:
                    yield from {node.module} & {f"{room}.{alias.name}" for alias in node.names}


def statements(node):
    """Statements in a node, at any depth; expressions, of which there are many more, hold none."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.stmt | ast.excepthandler | ast.match_case):
            yield child
            yield from statements(child)


def imported(tree, known, given=frozenset()):
    """Modules that a tree imports, at run time or for its types."""
    for node in statements(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module in known:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                yield full if full in known and full not in given else node.module


def test_no_module_imports_what_imports_it():
    known = modules()
    graph = {
        name: set(imported(ast.parse(path.read_text(encoding="utf-8")), known)) - {name}
        for name, path in known.items()
    }
    assert any(graph.values())
    TopologicalSorter(graph).prepare()


def test_a_circle_is_seen():
    here = ast.parse("if TYPE_CHECKING:\n    from a.b import C\nfrom a import d\n")
    assert set(imported(here, {"a", "a.b", "a.d"})) == {"a.b", "a.d"}
    with pytest.raises(ValueError, match="cycle"):
        TopologicalSorter({"a": {"b"}, "b": {"a"}}).prepare()


def test_tests_import_no_more_modules_of_the_rooms_than_the_guide_says():
    known = modules()
    inside = {name for name in known if name.count(".") > 1}
    names, found = frozenset(given(known)), set()
    for path in TESTS.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        found |= inside & set(imported(tree, known, names))
    told = re.search(r"The tests import (\d+) modules", GUIDE.read_text(encoding="utf-8"))
    assert len(found) <= int(told[1])
