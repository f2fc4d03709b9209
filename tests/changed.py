"""Print the files of tests that concern what changed against a branch, as many as fit in a time."""

import argparse
import ast
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from tests.order import ROOT, UNKNOWN, seconds

SMOKE = ("tests/golden/test_reference.py", "tests/unit/test_weighing.py")
"""Run whatever changed: masses of known drives, and what a weighing says."""


def changed(branch: str) -> set[str]:
    """Return the paths that differ from where the branch was left, uncommitted ones too."""

    def git(*words: str) -> list[str]:
        return subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.split("\n")

    committed = git("diff", "--name-only", f"{branch}...")
    return {
        *committed,
        *git("diff", "--name-only", "HEAD"),
        *git("ls-files", "-om", "--exclude-standard"),
    } - {""}


def imported(path: Path) -> set[str]:
    """Return what a file imports, by full name."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def concerned(paths: Iterable[str], tests: dict[str, set[str]]) -> list[str]:
    """Order the files of tests: changed ones, those of the module, of the room; short first."""
    paths = set(paths)
    modules = {
        ".".join(Path(p).relative_to("src").with_suffix("").parts).removesuffix(".__init__")
        for p in paths
        if p.startswith("src/weighbridge/") and p.endswith(".py")
    }
    rooms = {module.rsplit(".", 1)[0] for module in modules} - {"weighbridge"}
    stems = {f"test_{module.rsplit('.', 1)[-1]}" for module in modules}

    def far(test: str) -> int:
        if test in paths:
            return 0
        if tests[test] & modules or Path(test).stem in stems:
            return 1
        return 2 if tests[test] & rooms else 3

    known = seconds()
    return sorted(
        (t for t in tests if far(t) < 3), key=lambda t: (far(t), known.get(t, UNKNOWN), t)
    )


def fitting(ordered: Iterable[str], budget: float) -> tuple[list[str], list[str]]:
    """Take files until their time [s] is used up; return those taken and those left out."""
    known, taken, left = seconds(), [], []
    for test in dict.fromkeys((*SMOKE, *ordered)):
        budget -= known.get(test, UNKNOWN)
        (taken if budget >= 0.0 else left).append(test)
        if budget < 0.0:
            budget += known.get(test, UNKNOWN)
    return taken, left


def main() -> None:
    """Print the files that fit; name on standard error those that do not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", default="main", metavar="BRANCH")
    parser.add_argument("--budget", type=float, default=50.0, help="time of one process [s]")
    args = parser.parse_args()
    tests = {
        path.relative_to(ROOT).as_posix(): imported(path)
        for path in (ROOT / "tests").rglob("test_*.py")
    }
    taken, left = fitting(concerned(changed(args.against), tests), args.budget)
    sys.stdout.writelines(f"{test}\n" for test in taken)
    if left:
        near = " ".join(left[:8])
        sys.stderr.write(f"left to .ci/run: {len(left)} files of tests, the nearest {near}\n")


if __name__ == "__main__":
    main()
