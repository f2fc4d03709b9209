"""Pages of studies are their templates with figures."""

import re
from importlib import import_module
from pathlib import Path

import pytest

HOME = Path(__file__).parents[2]
PAGES = {
    "car_equipment": "studies/car_equipment.md",
    "clocks": "studies/clocks.md",
    "live": "docs/live_figures.md",
    "fleet_scale": "studies/fleet_scale.md",
    "gearboxes": "studies/gearboxes.md",
    "kerb": "studies/kerb.md",
    "night": "studies/night.md",
    "truck_fleet": "studies/truck_fleet.md",
}


@pytest.mark.parametrize("study", PAGES)
def test_a_page_is_its_template_with_figures(study):
    template = (HOME / "studies" / f"{study}.template.md").read_text(encoding="utf-8")
    pattern = re.sub(r"\\\{\w+\\\}", ".+?", re.escape(template))
    page = (HOME / PAGES[study]).read_text(encoding="utf-8")
    assert re.fullmatch(pattern, page, re.DOTALL)


def test_the_page_of_widths_is_what_its_program_makes(monkeypatch):
    monkeypatch.syspath_prepend(HOME / "studies")
    page = (HOME / "studies/width.md").read_text(encoding="utf-8")
    assert page == import_module("width").page()


def test_the_parts_whose_worth_is_measured_are_in_the_program(monkeypatch):
    for place in (HOME, HOME / "studies"):
        monkeypatch.syspath_prepend(place)
    ablation = import_module("ablation")

    parts = ablation._parts().values()
    assert len(parts) > 100
    assert [p for p in parts if not hasattr(import_module(p.module), p.name)] == []
