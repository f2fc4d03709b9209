"""Texts of the site have the contrast of WCAG AA, by the CSS of the theme and of docs/assets."""

import colorsys
import re
from pathlib import Path

import material
import pytest
from tests.contrast import contrast
from website.links import HOME

OWN = (HOME / "docs" / "assets" / "site.css").read_text(encoding="utf-8")
SHEETS = Path(material.__file__).parent / "templates" / "assets" / "stylesheets"
THEME = "".join(
    next(SHEETS.glob(f"{name}.*.css")).read_text(encoding="utf-8") for name in ("main", "palette")
)
RULE = re.compile(r"([^{}]+)\{([^{}]*)\}")
VARIABLE = re.compile(r"(--[\w-]+):\s*([^;}]+)")
HSLA = re.compile(r"hsla\(([\d.]+)deg,\s*([\d.]+)%,\s*([\d.]+)%,\s*([\d.]+)\)")
PAGE, CODE = "--md-default-bg-color", "--md-code-bg-color"
PAIRS = [
    ("--md-typeset-color", PAGE),
    ("--md-typeset-a-color", PAGE),
    ("--md-accent-fg-color", PAGE),
    ("--md-primary-bg-color", "--md-primary-fg-color"),
    ("--md-code-fg-color", CODE),
    *((f"--md-code-hl-{kind}-color", CODE)
      for kind in ("number", "special", "function", "constant", "keyword", "string", "comment",
                   "operator", "punctuation", "variable", "generic")),
]  # fmt: skip


def matches(selector: str, scheme: str) -> bool:
    """Whether a simple selector is that of a page of this scheme, in teal."""
    if not re.fullmatch(r"(:root|\*|(\[data-md-color-\w+=\"?[\w-]+\"?\])+(:not\(.*\))?)", selector):
        return False
    asked = re.findall(r"\[data-md-color-(\w+)=\"?([\w-]+)\"?\]", selector.partition(":not")[0])
    mine = {"scheme": scheme, "primary": "teal", "accent": "teal"}
    return all(mine[kind] == value for kind, value in asked) and ":not" not in selector


def variables(scheme: str) -> dict[str, str]:
    """Variables of a page of this scheme; the more exact selector wins, then the later one."""
    found: dict[str, tuple[int, str]] = {}
    css = re.sub(r"/\*.*?\*/", "", THEME + OWN, flags=re.DOTALL)
    css = re.sub(r"@media[^{]*screen[^{]*\{(?=\[data-md-color-scheme=slate\]\{)", "", css)
    for selectors, body in RULE.findall(css):
        ranks = [s.count("[") for s in selectors.split(",") if matches(s.strip(), scheme)]
        for name, value in VARIABLE.findall(body) if ranks else ():
            if max(ranks) >= found.get(name, (0, ""))[0]:
                found[name] = (max(ranks), value.strip())
    return {name: value for name, (_, value) in found.items()}


def colour(name: str, known: dict[str, str], behind: str = "#ffffff") -> str:
    """Colour of a variable as it is seen over what is behind it, ``#rrggbb``."""
    text = known[name]
    while "var(" in text:
        text = re.sub(r"var\((--[\w-]+)\)", lambda found: known[found[1]], text)
    if found := HSLA.fullmatch(text):
        hue, saturation, lightness, alpha = map(float, found.groups())
        rgb = colorsys.hls_to_rgb(hue / 360.0, lightness / 100.0, saturation / 100.0)
        parts = [255.0 * part for part in rgb]
    else:
        digits = text.removeprefix("#")
        digits = "".join(2 * d for d in digits) if len(digits) < 6 else digits
        parts = [int(digits[k : k + 2], 16) for k in (0, 2, 4)]
        alpha = int(digits[6:8] or "ff", 16) / 255.0
    below = [int(behind[k : k + 2], 16) for k in (1, 3, 5)]
    seen = [alpha * p + (1.0 - alpha) * b for p, b in zip(parts, below, strict=True)]
    return "#" + "".join(f"{round(part):02x}" for part in seen)


@pytest.mark.parametrize("scheme", ["default", "slate"])
@pytest.mark.parametrize(("text", "paper"), PAIRS)
def test_texts_of_the_site_have_the_contrast_of_wcag_aa(text, paper, scheme):
    known = variables(scheme)
    back = colour(paper, known)
    assert contrast(colour(text, known, back), back) >= 4.5


def test_tabs_are_seen_through_their_opacity():
    opacity = float(re.search(r"\.md-tabs__link \{ opacity: ([\d.]+);", OWN)[1])
    back = colour("--md-primary-fg-color", variables("default"))
    white = {"--tab": f"#ffffff{round(255 * opacity):02x}"}
    assert contrast(colour("--tab", white, back), back) >= 4.5


def test_the_colours_are_those_of_the_files():
    light, dark = variables("default"), variables("slate")
    assert colour("--md-primary-fg-color", light) == "#00796b"
    assert colour(PAGE, light) == "#ffffff"
    assert contrast(colour(PAGE, dark), "#000000") < 1.5
    assert colour("--half", {"--half": "hsla(0deg, 0%, 0%, 0.5)"}) == "#808080"
