"""Map tiles of a report: off unless asked for, where they belong, and from one server only."""

import re
from dataclasses import replace

import numpy as np
import pymap3d
import pytest
from tests.noted import error
from tests.unit.test_report import Elements, figures, make_weighing, written

from weighbridge import ConfigError
from weighbridge.balance import ForceBalance
from weighbridge.navigation.geodesy import LocalFrame

SERVER = "https://tiles.example.org/{z}/{x}/{y}.png"
MOST = 30
"""Tiles of one map."""


def on_map(tmp_path, latitude, longitude):
    """Return the images under the map of a drive along these places, and its middle [rad]."""
    w = make_weighing(hours=0.1)
    motion, table = w.result.balance.motion, w.result.balance.table
    part = np.linspace(0.0, 1.0, motion.time.size)
    along = np.linspace(0.0, 1.0, latitude.size)
    frame = LocalFrame(latitude[0], longitude[0], 0.0)
    latitude, longitude = (np.interp(part, along, x) for x in (latitude, longitude))
    ned = frame.to_ned(latitude, longitude, np.zeros(part.size))
    motion = replace(motion, position=(frame, ned))
    w = replace(w, result=replace(w.result, balance=ForceBalance(motion=motion, table=table)))
    (figure,) = [f for f in figures(written(tmp_path, [w], tiles=SERVER)).values()
                 if "images" in f["layout"]]  # fmt: skip
    return figure["layout"]["images"], (np.median(latitude), np.median(longitude))


def corners(image):
    """West, east, south and north of an image [km]."""
    x, y = image["x"], image["y"]
    return x, x + image["sizex"], y - image["sizey"], y


def test_no_address_is_in_a_page_that_was_not_asked_for_tiles(tmp_path):
    html = written(tmp_path, [make_weighing()])
    assert 'img-src data:"' in html
    assert "for map tiles" not in html
    assert not any("images" in f["layout"] for f in figures(html).values())


def test_the_server_is_allowed_told_and_the_only_one(tmp_path):
    html = written(tmp_path, [make_weighing()], tiles=SERVER)
    assert 'img-src data: https://tiles.example.org"' in html
    page = Elements(html)
    assert "This page asks https://tiles.example.org for map tiles." in page.text
    assert "Map tiles from tiles.example.org." in page.text
    drawn = [f for f in figures(html).values() if "images" in f["layout"]]
    sources = [i["source"] for f in drawn for i in f["layout"]["images"]]
    assert 0 < len(sources) <= MOST
    assert all(re.fullmatch(r"https://tiles.example.org/\d+/\d+/\d+.png", s) for s in sources)
    assert len(set(sources)) == len(sources)


def test_tiles_lie_where_they_belong_and_cover_the_track(tmp_path):
    latitude = np.radians(np.linspace(48.0, 48.05, 50))
    longitude = np.radians(np.linspace(11.5, 11.6, 50))
    images, middle = on_map(tmp_path, latitude, longitude)
    bounds = np.array([corners(i) for i in images])
    east, north, _ = pymap3d.geodetic2enu(latitude, longitude, 0.0, *middle, 0.0, deg=False)
    for x, y in zip(east / 1e3, north / 1e3, strict=True):
        holds = (
            (bounds[:, 0] <= x + 0.01) & (x <= bounds[:, 1] + 0.01)
            & (bounds[:, 2] <= y + 0.01) & (y <= bounds[:, 3] + 0.01)
        )  # fmt: skip
        assert holds.any()
    # The tile of one place, by another form of the projection.
    zoom = int(images[0]["source"].split("/")[3])
    degrees = 48.0372, 11.5755
    lat = np.radians(degrees[0])
    column = int((degrees[1] + 180.0) / 360.0 * 2**zoom)
    row = int((1.0 - np.log(np.tan(lat) + 1.0 / np.cos(lat)) / np.pi) / 2.0 * 2**zoom)
    name = f"https://tiles.example.org/{zoom}/{column}/{row}.png"
    image = next(i for i in images if i["source"] == name)
    x, y, _ = pymap3d.geodetic2enu(*degrees, 0.0, *np.degrees(middle), 0.0)
    west, right, south, top = corners(image)
    assert west <= x / 1e3 <= right
    assert south <= y / 1e3 <= top


@pytest.mark.parametrize("extent", [1e-9, 1e-4, 0.01, 0.2])
def test_a_drive_of_any_length_asks_for_few_tiles(tmp_path, extent):
    latitude = 0.9 + np.linspace(0.0, extent, 20)
    images, _ = on_map(tmp_path, latitude, np.full(20, 0.2))
    assert 1 <= len(images) <= MOST


@pytest.mark.parametrize(
    "address",
    ["", "https://tiles.example.org/", "ftp://a/{z}/{x}/{y}", "{z}/{x}/{y}",
     "https://a;script-src *//{z}/{x}/{y}", 'https://a"/{z}/{x}/{y}', "https://a\n/{z}/{x}/{y}"],
)  # fmt: skip
def test_what_is_no_address_of_tiles_is_refused(tmp_path, address):
    with error(ConfigError, "{z} {x} {y}"):
        written(tmp_path, [make_weighing()], tiles=address)
