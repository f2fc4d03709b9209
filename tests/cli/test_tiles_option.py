"""``weigh --tiles``: maps over a tile server, only where a report is asked for."""

from pathlib import Path

from tests.noted import named

GOLDEN = Path(__file__).parent.parent / "golden"
SERVER = "https://tiles.example.org/{z}/{x}/{y}.png"


def test_tiles_need_a_report_and_an_address(weighbridge, tmp_path):
    car = tmp_path / "car.toml"
    car.write_text("[vehicle]\n[mounting]\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 0\n")
    words = ("weigh", GOLDEN / "csv", "--vehicle", car)
    ran = weighbridge(*words, "--tiles", SERVER)
    assert ran.code == 2
    assert named(ran.err, "--tiles --report")
    page = tmp_path / "r.html"
    ran = weighbridge(*words, "--report", page, "--tiles", "tiles.example.org")
    assert ran.code == 2
    assert named(ran.err, "tiles.example.org {z} {x} {y}")
    assert not page.exists()
    ran = weighbridge(*words, "--report", page, "--tiles", SERVER)
    assert ran.code == 1
    assert "img-src data: https://tiles.example.org" in page.read_text("utf-8")
