"""Write the small position logs of this folder: the drive of make_logs.py as receivers log it.

Run it from anywhere: ``python tests/golden/make_position_logs.py``. The drive
begins at 23:59:58 UTC on 5 March 2021, so every clock wraps at midnight.
"""

import datetime as dt
from functools import reduce
from pathlib import Path

import numpy as np
from make_logs import GNSS_TIME, truth

HERE = Path(__file__).parent
START = dt.datetime(2021, 3, 5, 23, 59, 58, tzinfo=dt.UTC)
KNOT = 1852.0 / 3600.0


def row(t: float) -> dict[str, float]:
    """Position and speed of one instant, in SI and degrees."""
    at = np.array([t])
    names = ("latitude", "longitude", "altitude", "gnss_speed")
    values = {n: float(truth(n, at)[0]) for n in names}
    values["latitude"] = float(np.degrees(values["latitude"]))
    # West of Greenwich, where the sign of the longitude matters.
    values["longitude"] = -float(np.degrees(values["longitude"]))
    return values


def minutes(value: float, digits: int) -> str:
    """Write an angle as NMEA does: degrees and minutes run together."""
    whole = int(abs(value))
    return f"{whole:0{digits}d}{60.0 * (abs(value) - whole):010.7f}"


def sentence(body: str) -> str:
    """Add the checksum."""
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}\r\n"


def nmea() -> str:
    """Write GGA before RMC, as many receivers do: the date comes after midnight has passed."""
    lines = []
    for t in GNSS_TIME:
        r, when = row(t), START + dt.timedelta(seconds=t)
        lat, lon = minutes(r["latitude"], 2), minutes(r["longitude"], 3)
        place = f"{lat},N,{lon},W"
        clock = when.strftime("%H%M%S.00")
        lines.append(sentence(f"GPGGA,{clock},{place},1,09,0.9,{r['altitude']:.1f},M,47.0,M,,"))
        speed = f"{r['gnss_speed'] / KNOT:.6f}"
        date = when.strftime("%d%m%y")
        lines.append(sentence(f"GPRMC,{clock},A,{place},{speed},0.0,{date},,,A"))
        lines.append(sentence("GPGSV,1,1,00"))
    return "".join(lines)


def gpx() -> str:
    """GPX 1.1 with the extension for speed of Garmin."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<gpx version="1.1" creator="make_position_logs" xmlns="http://www.topografix.com/GPX/1/1" '
        'xmlns:t="http://www.garmin.com/xmlschemas/TrackPointExtension/v2"><trk><trkseg>',
    ]
    for t in GNSS_TIME:
        r, when = row(t), START + dt.timedelta(seconds=t)
        lines.append(
            f'<trkpt lat="{r["latitude"]:.9f}" lon="{r["longitude"]:.9f}">'
            f"<ele>{r['altitude']:.1f}</ele><time>{when:%Y-%m-%dT%H:%M:%SZ}</time>"
            f"<extensions><t:TrackPointExtension><t:speed>{r['gnss_speed']:.4f}</t:speed>"
            "<t:course>0.0</t:course></t:TrackPointExtension></extensions></trkpt>"
        )
    return "\n".join([*lines, "</trkseg></trk></gpx>", ""])


def vbo() -> str:
    """VBOX: minutes, west positive, satellites with the flag of differential correction."""
    head = """File created on 05/03/2021 at 23:59:57

[header]
satellites
time
latitude
longitude
velocity knots
heading
height
vertical velocity kmh

[channel units]

[comments]
(c) 2001 2003 Racelogic

[column names]
sats time lat long velocity heading height vert-vel

[data]
"""
    lines = []
    for t in GNSS_TIME:
        r, when = row(t), START + dt.timedelta(seconds=t)
        lines.append(
            f"137 {when:%H%M%S}.00 {60 * r['latitude']:+.7f} {-60 * r['longitude']:+.7f} "
            f"{r['gnss_speed'] / KNOT:.6f} 000.00 {r['altitude']:+.2f} +000.000\n"
        )
    return head + "".join(lines)


if __name__ == "__main__":
    (HERE / "log.nmea").write_bytes(nmea().encode("ascii"))
    (HERE / "log.gpx").write_text(gpx(), encoding="utf-8")
    (HERE / "log.vbo").write_text(vbo(), encoding="utf-8")
