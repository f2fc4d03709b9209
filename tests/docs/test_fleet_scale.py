"""What the page of the fleet says of the study of scales."""

from pathlib import Path

HOME = Path(__file__).parents[2]


def test_the_figures_of_the_fleet_are_those_of_the_study():
    study = (HOME / "studies" / "fleet_scale.md").read_text(encoding="utf-8")
    rows = {
        cells[0]: cells[1:]
        for line in study.splitlines()
        if len(cells := [cell.strip() for cell in line.strip("|").split("|")]) == 9
    }
    page = (HOME / "docs" / "fleet.md").read_text(encoding="utf-8")
    raw, without, ticket = (
        rows[name]
        for name in ("as weighed", "learnt without a ticket", "learnt with one ticket per type")
    )

    page = page.replace("\n", " ")
    assert f"the RMS error falls from {raw[0]} to {without[0]}, and to {ticket[0]} with" in page
    assert f"{without[2]} of the intervals hold" in page
    assert f"{without[3]} vehicles get worse by more than 0.5 %" in page
    assert f"The sum of t·km is {without[6]} in place of {raw[6]}" in page
    # Of odd vehicles: their number, and how many were not taken for empty ones.
    odd = {
        cells[0]: [int(cell) for cell in cells[1:5]]
        for line in study.splitlines()
        if len(cells := [cell.strip() for cell in line.strip("|").split("|")]) == 8
        and cells[1].isdigit()
    }
    count, _, *found = odd["wrong tare"]
    assert f"Of {count} registered masses wrong by 5 % the study recognises {sum(found)}" in page
    count, empty, *_ = odd["crane"]
    assert f"of {count} vehicles with a crane all" in page
    assert empty == 0
