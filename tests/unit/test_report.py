"""The report page: what it says, and that it needs nothing from outside."""

import base64
import gzip
import json
import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import error, noted

from weighbridge import ConfigError, Drive, DriveInfo, Segment, Signal, Status, Vehicle, Weighing
from weighbridge.balance import ForceBalance, ForceTable, Reason
from weighbridge.estimators import MassTrack
from weighbridge.navigation import Motion
from weighbridge.navigation.geodesy import LocalFrame
from weighbridge.report import mass_figure, write_report
from weighbridge.results import Calibration, DelaySearch, FittedRows
from weighbridge.vehicle import Driveline, Provenance, RoadLoad, TorqueModel, detect_gearings

MASS = 1500.0
GEARINGS = (40.0, 25.0, 16.0)
VEHICLE = Vehicle(
    name="test car",
    tare=1400.0,
    driveline=Driveline(gearings=GEARINGS, wheel_inertia=4.0, engine_inertia=0.1),
    road_load=RoadLoad(drag_area=0.6, rolling_coefficient=0.01),
)


class Elements(HTMLParser):
    """Start tags with their attributes, visible text, and whether tags match."""

    VOID = frozenset({"meta", "link", "br"})

    def __init__(self, html):
        super().__init__()
        self.tags, self.open, self.text, self.matched = [], [], "", True
        self.feed(html)
        self.matched &= not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        self.matched &= bool(self.open) and self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] not in ("script", "style"):
            self.text += data

    def attributes(self, name):
        return [attrs[name] for _, attrs in self.tags if name in attrs]


def make_weighing(
    name="first drive", *, status=Status.CONVERGED, why="", altitude=True, gnss=True, hours=0.5
):
    rng = np.random.default_rng(3)
    time = 50.0 + np.arange(0.0, 3600.0 * hours, 0.2)
    n = time.size
    speed = 12.0 - 12.0 * np.cos(2.0 * np.pi * (time - 50.0) / 120.0)
    accel = np.gradient(speed, time)
    distance = np.cumsum(speed) * 0.2
    grade = 0.03 * np.sin(distance / 800.0)
    nowhere = np.full(n, np.nan)
    motion = Motion(
        source="inertial",
        time=time,
        speed=speed,
        accel=accel,
        specific_force=accel + 9.81 * np.sin(grade),
        grade=grade,
        pitch=grade + 0.003 * accel,
        roll=np.zeros(n),
        heading=nowhere,
        distance=distance,
        altitude=20.0 - 24.0 * np.cos(distance / 800.0) if altitude else nowhere,
        position=(LocalFrame(0.97, 0.2, 0.0), distance[:, None] * [1.0, 0.0, 0.0])
        if gnss
        else None,
        valid=np.ones(n, dtype=bool),
        specific_force_std=0.05,
        grade_std=np.full(n, 0.004),
        squat=0.003,
    )
    gear = np.clip(1 + (speed / 6.0).astype(np.int64), 1, 3)
    gearing = np.array(GEARINGS)[gear - 1]
    line = VEHICLE.driveline
    rotating = line.wheel_inertia / line.wheel_radius**2 + line.engine_inertia * gearing**2
    drag = 0.5 * 1.2 * VEHICLE.road_load.drag_area * speed**2
    noise = rng.normal(scale=60.0, size=n)
    weight = motion.specific_force + 9.81 * 0.01 * np.cos(grade)
    traction = MASS * weight + drag + rotating * accel + noise
    reason = np.where(accel > 0.0, Reason.USED, Reason.NOT_ACCELERATING).astype(np.uint8)
    reason[speed < 1.5] = Reason.STANDING
    reason[1003] = Reason.BAD_FIT
    table = ForceTable(
        time=time,
        traction_force=traction,
        force_std=np.full(n, 60.0),
        torque=traction / gearing,
        engine_speed=gearing * speed,
        speed=speed,
        accel=accel,
        specific_force=motion.specific_force,
        grade=grade,
        pitch=motion.pitch,
        heading=nowhere,
        gear=gear,
        gearing=gearing,
        air_speed=speed,
        air_density=np.full(n, 1.2),
        fuel_burnt=np.zeros(n),
        reason=reason,
    )
    result = MassTrack(
        method="rls",
        balance=ForceBalance(motion=motion, table=table),
        running_mass=MASS + 300.0 * np.exp(-(time - 50.0) / 100.0),
        running_std=np.full(n, 12.0),
        residual=np.where(reason == Reason.USED, noise, np.nan),
        row_reason=reason,
        mass=MASS,
        std=10.0,
        degrees_of_freedom=20.0,
        bound_std=2.0,
        converged_at=200.0,
        status=status,
        reason=noted(why) if why else None,
        segments=(
            Segment(start=50.0, end=500.0, mass=1490.0, std=20.0),
            Segment(start=500.0, end=1800.0, mass=float("nan"), std=float("nan")),
        ),
    )
    return Weighing(
        drive=Drive(name, {"vehicle_speed": Signal("vehicle_speed", time, speed)}),
        vehicle=VEHICLE,
        seen=VEHICLE,
        method="rls",
        status=status,
        refusal=noted(why) if why else None,
        result=result,
        problems=(noted("the torque delay was found from this drive"),),
    )


def make_calibration(weighing):
    balance = weighing.result.balance
    table = balance.table
    rng = np.random.default_rng(4)
    torque = balance.table.torque[table.usable]
    turning = balance.table.engine_speed[table.usable]
    rows = FittedRows(
        time=table.time[table.usable],
        drive=np.zeros(torque.size, dtype=np.int64),
        # 210 Nm at full load, less friction that grows with speed.
        reading=(torque + 10.0 + 0.02 * turning) / 210.0,
        engine_speed=turning,
        source_torque=torque,
        motion_torque=torque + rng.normal(scale=2.0, size=torque.size),
    )
    vehicle = replace(
        VEHICLE,
        torque=TorqueModel(
            source="load",
            coefficients=(-10.0, 210.0, -0.02),
            coefficient_stds=(0.5, 1.0, 0.001),
        ),
        provenance=Provenance(
            drives=("known drive",),
            masses=(MASS,),
            r_squared=rows.r_squared,
            residual_std=rows.residual_std,
            samples=torque.size,
        ),
    )
    return Calibration(
        vehicle=vehicle,
        gears=detect_gearings(table.time, balance.table.engine_speed, table.speed, idle_speed=0.0),
        balances=(balance,),
        rows=rows,
        search=DelaySearch(delay=np.array([0.0, 0.1, 0.2]), misfit=np.array([9.0, 0.0, 4.0])),
        held=(),
    )


def written(tmp_path, weighings, **options):
    path = tmp_path / "report.html"
    write_report(weighings, path, **options)
    return path.read_text(encoding="utf-8")


def figures(html):
    return json.loads(unpacked(html, "figures"))


def unpacked(html, key):
    """Unpack a text that the page carries."""
    found = re.search(rf'<script type="text/plain" id="{key}">(.*?)</script>', html, re.S)
    return gzip.decompress(base64.b64decode(found.group(1))).decode()


def numbers(array):
    if isinstance(array, dict):
        return np.frombuffer(base64.b64decode(array["bdata"]), dtype=array["dtype"])
    return np.asarray(array, dtype=np.float64)


def over(html, axis, across=""):
    """Return the figures of a page over such an axis, with such words on the other one."""
    titled = [f["layout"] for f in figures(html).values()]
    return [
        figure
        for figure, layout in zip(figures(html).values(), titled, strict=True)
        if layout["xaxis"]["title"]["text"] == axis
        and across in layout.get("yaxis", {}).get("title", {}).get("text", "")
    ]


def table(html, key):
    """Return the rows of the table in a section, by their first cells."""
    inside = re.search(rf'<section id="[^"]*{key}">(.*?)</section>', html, re.S).group(1)
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", inside)
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows]
    return {first: rest for first, *rest in filter(None, cells)}


def titles(html):
    return re.findall(r"<h4>([^<]*)</h4><div class=\"plot\"", html)


def test_page_answers_first(tmp_path):
    weighing = make_weighing()
    page = Elements(written(tmp_path, [weighing]))
    half = 0.5 * np.diff(weighing.interval(0.95))[0]
    answer = f"1500 ± {half:.0f} kg"
    assert answer in page.text
    assert page.text.index(answer) < page.text.index("payload")
    for said in (
        f"+100 ± {half:.0f} kg",
        "test car",
        "rls",
        "30.0 min",
        "The torque delay was found",
    ):
        assert said in page.text
    assert page.matched


def test_page_asks_no_network_for_anything(tmp_path):
    weighing = make_weighing()
    html = written(tmp_path, [weighing], calibration=make_calibration(weighing))
    page = Elements(html)
    inside = [link for link in page.attributes("href") if not link.startswith("#")]
    assert inside == ["data:,"]
    assert page.attributes("src") == []
    styles = re.findall(r"<style>(.*?)</style>", html, re.S)
    assert len(styles) == 1
    assert "@import" not in styles[0]
    assert "url(" not in styles[0]
    # Figures that would fetch tiles or outlines of countries.
    kinds = {trace["type"] for figure in figures(html).values() for trace in figure["data"]}
    assert kinds <= {"scatter", "bar"}


def test_names_are_escaped_everywhere(tmp_path):
    evil = "</script><script>alert(1)</script><b>&\"'"
    weighing = make_weighing(evil)
    weighing = replace(
        weighing,
        vehicle=replace(VEHICLE, name=evil),
        problems=(noted(evil),),
        status=Status.NOT_EXCITED,
        refusal=noted(evil),
    )
    plain = Elements(written(tmp_path, [make_weighing()] * 2))
    page = Elements(written(tmp_path, [weighing] * 2, title=evil))
    assert [t for t, _ in page.tags if t in ("script", "b")] == [
        t for t, _ in plain.tags if t in ("script", "b")
    ]
    assert "<script>alert(1)</script><b>&\"'" in page.text
    assert page.matched
    # Texts of figures cannot end the script that holds them.
    html = written(tmp_path, [weighing], calibration=make_calibration(weighing), title=evil)
    data = re.search(r'id="figures">(.*?)</script>', html, re.S).group(1)
    assert re.fullmatch("[A-Za-z0-9+/=]+", data)


def test_several_drives_are_compared_in_a_table(tmp_path):
    known = replace(make_weighing("known"), vehicle=replace(VEHICLE, tare=None))
    poor = make_weighing("poor", status=Status.NOT_EXCITED, why="only 3 usable samples")
    html = written(tmp_path, [make_weighing("plain"), known, poor], truth={"known": 1470.0})
    cells = re.findall(r"<tr>(.*?)</tr>", html)
    rows = [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row) for row in cells[:4]]
    low, high = known.interval(0.95)
    interval = f"{low:.0f} to {high:.0f} kg"
    sure = f"fine: ± {100.0 * 0.5 * (high - low) / MASS:.1f} %"
    assert rows[1] == ["plain", "1500 kg", interval, "+100 kg", "–", "–", sure]
    assert rows[2] == ["known", "1500 kg", interval, "–", "1470 kg", "+2.0 %", sure]
    assert rows[3][:6] == ["poor", "–", "–", "–", "–", "–"]
    assert "only 3 usable samples" in rows[3][6]
    page = Elements(html)
    sections = [attrs for tag, attrs in page.tags if tag == "details"]
    assert sum("open" in attrs for attrs in sections) == 1
    keys = page.attributes("id")
    assert len(keys) == len(set(keys))
    assert sum(key.startswith("figure-") for key in keys) == len(figures(html))


def test_known_mass_of_the_drive_serves_as_truth(tmp_path):
    weighing = make_weighing()
    drive = replace(weighing.drive, info=replace(weighing.drive.info, mass=1600.0))
    page = Elements(written(tmp_path, [replace(weighing, drive=drive)]))
    assert "−6.2 % off" in page.text


@pytest.mark.parametrize("status", [Status.NOT_EXCITED, Status.INCONSISTENT])
def test_page_without_mass_says_why_and_names_none(tmp_path, status):
    page_html = written(tmp_path, [make_weighing(status=status, why="the road was too flat")])
    page = Elements(page_html)
    assert "The road was too flat." in page.text
    assert "1500 ±" not in page.text
    mass = figures(page_html)["figure-1"]
    assert not any("final" in trace.get("name", "") for trace in mass["data"])
    assert "no result" in titles(page_html)[0]


def test_page_of_a_drive_that_lacks_signals(tmp_path):
    weighing = replace(
        make_weighing(), status=Status.MISSING_SIGNALS, refusal=noted("no engine_load"), result=None
    )
    html = written(tmp_path, [weighing])
    page = Elements(html)
    assert "No engine_load." in page.text
    assert titles(html) == ["Speed as recorded"]
    assert "Left out: No mass over time" in page.text
    with pytest.raises(ConfigError, match="first drive: no mass over time"):
        mass_figure(weighing)


def test_missing_altitude_and_position_leave_a_sentence(tmp_path):
    full = written(tmp_path, [make_weighing()])
    bare = written(tmp_path, [make_weighing(altitude=False, gnss=False)])
    lost = {"Pitch and grade should follow the hills", "Where the drive went, and how fast"}
    assert set(titles(full)) - set(titles(bare)) == lost
    for sentence in (
        "No map: no position is known",
        "No pitch against altitude: no altitude is known",
    ):
        assert sentence not in Elements(full).text
        assert sentence in Elements(bare).text


def test_recorded_fixes_serve_where_the_motion_has_no_position(tmp_path):
    weighing = make_weighing(gnss=False)
    time = np.arange(60.0, 300.0)
    # A metre of latitude is 1/M, with M the meridian radius of WGS 84.
    step = 7.0 / (6378137.0 * (1 - 0.00669438) / (1 - 0.00669438 * np.sin(0.9) ** 2) ** 1.5)
    drive = weighing.drive.with_signals(
        Signal("latitude", time, 0.9 + step * np.arange(time.size)),
        Signal("longitude", time, np.full(time.size, 0.1)),
    )
    html = written(tmp_path, [replace(weighing, drive=drive)])
    place = 1 + titles(html).index("Where the drive went, and how fast")
    figure = figures(html)[f"figure-{place}"]
    north = numbers(figure["data"][0]["y"])
    assert_allclose(north[-1] - north[0], 0.007 * (time.size - 1), rtol=1e-4)
    assert figure["layout"]["yaxis"]["scaleanchor"] == "x"


def test_legend_counts_every_sample(tmp_path):
    weighing = make_weighing(hours=2.0)
    html = written(tmp_path, [weighing])
    speed = figures(html)["figure-2"]
    told = dict(re.findall(r"^(.*) \((\d+)\)$", t["name"])[0] for t in speed["data"][1:])
    reason = weighing.result.row_reason
    assert sum(int(count) for count in told.values()) == reason.size
    assert int(told["used"]) == np.count_nonzero(reason == Reason.USED)
    assert told["bad fit"] == "1"
    rare = next(t for t in speed["data"] if t["name"] == "bad fit (1)")
    kmh = 3.6 * weighing.result.balance.table.speed[1003]
    assert_allclose(numbers(rare["y"]), [kmh], rtol=2e-5)


def test_every_figure_has_title_units_and_caption(tmp_path):
    weighing = make_weighing()
    html = written(tmp_path, [weighing], calibration=make_calibration(weighing))
    drawn = figures(html)
    assert len(titles(html)) == len(drawn) == 17
    assert len(re.findall(r"<figcaption>[^<]+\.</figcaption>", html)) == len(drawn)
    for figure in drawn.values():
        axes = [v for k, v in figure["layout"].items() if re.fullmatch(r"[xy]axis\d?", k)]
        named = [axis["title"]["text"] for axis in axes]
        assert all(
            re.search(r"\[.+\]$", text) or text in ("", "Samples within 2 %") for text in named
        )


def test_calibration_shows_the_gears_found(tmp_path):
    weighing = make_weighing()
    calibration = make_calibration(weighing)
    html = written(tmp_path, [], calibration=calibration)
    assert "3 gears stand out" in Elements(html).text
    histogram = figures(html)["figure-1"]["layout"]
    marks = sorted(shape["x0"] for shape in histogram["shapes"])
    assert_allclose(marks, sorted(GEARINGS), rtol=1e-3)
    r_squared = re.search(r"R² = (0\.\d+)", html).group(1)
    assert float(r_squared) == pytest.approx(calibration.rows.r_squared, abs=5e-4)


def test_calibration_without_gears_or_engine_speed_leaves_sentences(tmp_path):
    calibration = make_calibration(make_weighing())
    car = replace(
        calibration.vehicle,
        torque=TorqueModel(coefficients=(0.0, 1.0), coefficient_stds=(1.0, 0.1)),
    )
    calibration = replace(calibration, gears=None, vehicle=car)
    page = Elements(written(tmp_path, [], calibration=calibration))
    assert "No distribution of gear ratios: they were given" in page.text
    assert "No torque over engine speed" in page.text


def test_long_drive_stays_small(tmp_path):
    html = written(tmp_path, [make_weighing(hours=1.25)])
    assert html.count('id="library"') == 1
    assert len(html.encode()) < 800_000
    twice = written(tmp_path, [make_weighing(hours=1.25), make_weighing(hours=4.0)])
    assert twice.count('id="library"') == 1
    assert len(twice) < len(html) + 200_000


def test_nothing_to_report_and_nowhere_to_write_are_said(tmp_path):
    with error(ConfigError, "report.html"):
        write_report([], tmp_path / "report.html")
    with pytest.raises(ConfigError, match="cannot be written"):
        write_report([make_weighing()], tmp_path / "no folder" / "report.html")


def test_mass_figure_draws_the_answer():
    weighing = make_weighing()
    figure = mass_figure(weighing, truth=1520.0)
    traces = {trace.name: trace for trace in figure.data}
    assert_allclose(traces["final mass 1500 kg"].y, MASS)
    assert_allclose(traces["true mass 1520 kg"].y, 1520.0)
    running = traces["running mass"]
    first = np.argmax(weighing.result.used)
    assert_allclose(running.x[0], (weighing.result.time[first] - 50.0) / 60.0, rtol=2e-5)
    assert_allclose(running.y[0], weighing.result.running_mass[first], rtol=2e-5)
    low, high = figure.layout.yaxis.range
    assert low < 0.95 * MASS < 1.05 * MASS < high
    assert "1500 kg" in figure.layout.title.text
    assert figure.layout.margin.t >= 80


def test_mass_figure_has_the_known_mass_of_the_drive():
    weighing = make_weighing()
    known = replace(weighing, drive=replace(weighing.drive, info=DriveInfo(mass=1510.0)))
    named = [[trace.name or "" for trace in mass_figure(w).data] for w in (known, weighing)]
    assert [any("true mass" in name for name in names) for names in named] == [True, False]


def test_a_long_line_keeps_its_extremes_its_ends_and_its_gap(tmp_path):
    weighing = make_weighing(hours=4.0)
    table = weighing.result.balance.table
    speed = table.speed.copy()
    speed[23_456], speed[40_123] = 50.0, 0.25
    grade = np.where((table.time > 3000.0) & (table.time < 4500.0), np.nan, table.grade)
    table = replace(table, speed=speed, grade=grade)
    motion = replace(weighing.result.balance.motion, speed=speed, grade=grade)
    result = replace(weighing.result, balance=ForceBalance(motion=motion, table=table))
    html = written(tmp_path, [replace(weighing, result=result)])
    (figure,) = over(html, "Time since start [min]", "Speed")
    x, y = (numbers(figure["data"][0][axis]) for axis in "xy")
    assert x.size < 0.1 * speed.size
    assert np.nanmax(y) == pytest.approx(180.0, rel=1e-4)
    assert (x[0], x[-1]) == pytest.approx((0.0, 240.0), abs=0.01)
    assert np.all(np.diff(x[np.isfinite(y)]) >= 0.0)
    road = over(html, "Distance [km]", "rade")[0]["data"][-1]
    assert np.isnan(numbers(road["y"])).any()


def test_report_loads_plotly_only_when_used():
    code = "import sys, weighbridge.report; sys.exit('plotly' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
