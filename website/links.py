"""Links of the repository's pages, as they stand on the site."""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
"""The repository."""

_PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "LICENSE": "licence.md",
    "SECURITY.md": "security.md",
    "benchmarks/README.md": "benchmarks.md",
    "benchmarks": "benchmarks.md",
    "studies": "accuracy.md",
    "docs": "index.md",
}
_LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")
_FENCE = re.compile(r"(^[ ]*```.*?^[ ]*```[ ]*$|`[^`\n]+`)", re.MULTILINE | re.DOTALL)


def outside_pages() -> dict[str, Path]:
    """Return pages and files that the site takes from outside docs/: place on the site to file."""
    found = {
        place: HOME / source
        for source, place in _PAGES.items()
        if place.endswith(".md") and source.endswith(".md") and source != "README.md"
    }
    for study in sorted((HOME / "studies").glob("*.md")):
        if not study.name.endswith(".template.md"):
            found[f"studies/{study.name}"] = study
    for figure in sorted((HOME / "studies" / "figures").glob("*.png")):
        found[f"studies/figures/{figure.name}"] = figure
    examples = (p for p in (HOME / "examples").rglob("*") if p.suffix in (".toml", ".ino", ".py"))
    for example in sorted(examples):
        found[example.relative_to(HOME).as_posix()] = example
    return found


def pages() -> list[Path]:
    """Return the Markdown files that the site shows, and the README."""
    outside = (path for path in outside_pages().values() if path.suffix == ".md")
    return sorted({HOME / "README.md", *(HOME / "docs").rglob("*.md"), *outside})


def source_of(place: str) -> str:
    """Return the path in the repository of a page of the site."""
    for source, page in _PAGES.items():
        if page == place and source.endswith(".md") and source != "README.md":
            return source
    return place if place.startswith(("studies/", "examples/")) else f"docs/{place}"


def on_site(target: str) -> str | None:
    """Return the place on the site of a path in the repository; none where it is not there."""
    target = target.rstrip("/")
    if target in _PAGES:
        return _PAGES[target]
    if target.startswith("docs/"):
        return target.removeprefix("docs/")
    if (HOME / target).is_dir() and target.startswith("examples/"):
        inside = sorted((HOME / target).glob("vehicle.toml")) or sorted(
            (HOME / target).glob("*.toml")
        )
        return inside[0].relative_to(HOME).as_posix() if inside else None
    return target if target in outside_pages() else None


def relinked(text: str, place: str) -> str:
    """Turn the links of a page into those of the site; a link to code becomes its words.

    Parameters
    ----------
    text
        The page, Markdown.
    place
        Where it lies on the site, such as ``studies/accuracy.md``.
    """
    here = posixpath.dirname(source_of(place))

    def turned(link: re.Match[str]) -> str:
        mark, words, address = link.groups()
        path, hash_mark, anchor = address.partition("#")
        if not path or re.match(r"[a-z]+:", path):
            return link[0]
        target = on_site(posixpath.normpath(posixpath.join(here, path)))
        if target is None:
            return words if words.startswith("`") else f"`{words}`"
        near = posixpath.relpath(target, posixpath.dirname(place) or ".")
        return f"{mark}[{words}]({near}{hash_mark}{anchor})"

    parts = _FENCE.split(text)
    return "".join(p if k % 2 else _LINK.sub(turned, p) for k, p in enumerate(parts))
