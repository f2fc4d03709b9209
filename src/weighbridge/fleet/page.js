"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const names = data.names;
const PAGE = 20;

function make(tag, text, kind) {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (kind) element.className = kind;
  return element;
}
const place = (key) => document.querySelector(`#${key} .body`);
// A number is never broken at its thousands, nor before its ±.
const plain = new Intl.NumberFormat("en");
const number = (x, unit = "") => (x === null ? "–" : plain.format(x).replaceAll(",", "\u202f") + unit);
const pair = (x, half) => (x === null ? "–" : `${number(x)} ±\u00a0${number(Math.round(half))}`);
const percent = (x) => (x === null ? "–" : `${(100 * x).toFixed(1)} %`);
const sure = (x) => (x !== null && x > 0.999 ? "> 99.9 %" : percent(x));
const time = (x) => (x === null ? "–" : new Date(1000 * x).toISOString().slice(0, 16).replace("T", " "));
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// A table that sorts by a click on a head and filters by what is typed; rows come 20 at first, 200 more at a time.
function table(key, count, columns, order) {
  const body = place(key);
  if (!count) { body.append(make("p", "Nothing to show.", "absent")); return; }
  const tools = make("div", undefined, "tools");
  const filter = make("input");
  filter.type = "search"; filter.placeholder = "filter"; filter.setAttribute("aria-label", "filter");
  const note = make("span", "", "note");
  tools.append(filter, note);
  const scroll = make("div", undefined, "scroll");
  const grid = make("table"), head = make("thead"), rows = make("tbody"), line = make("tr");
  const more = make("button", "Show more", "more");
  let shown = PAGE, by = order[0], down = order[1], found = [];
  const texts = Array.from({ length: count }, (_, k) =>
    columns.map((c) => String(c.show ? c.show(c.value(k), k) : c.value(k) ?? "–")));
  const words = texts.map((cells) => cells.join("\n").replace(/[\u00a0\u202f]/g, " ").toLowerCase());
  function draw() {
    const parts = document.createDocumentFragment();
    for (const k of found.slice(0, shown)) {
      const row = make("tr");
      columns.forEach((c, n) => {
        const cell = make("td", c.press ? undefined : texts[k][n], c.kind || "");
        if (c.mark) cell.classList.add(...c.mark(k));
        if (c.press) {
          const button = make("button", texts[k][n]);
          button.addEventListener("click", () => c.press(k));
          cell.append(button);
        }
        row.append(cell);
      });
      parts.append(row);
    }
    rows.replaceChildren(parts);
    more.hidden = found.length <= shown;
    note.textContent = `${Math.min(shown, found.length)} of ${found.length}`;
  }
  function arrange() {
    const wanted = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    found = [];
    for (let k = 0; k < count; k++) if (wanted.every((w) => words[k].includes(w))) found.push(k);
    const value = columns[by].value, sign = down ? -1 : 1;
    found.sort((a, b) => {
      const x = value(a), y = value(b);
      if (x === null || y === null) return (x === null) - (y === null);
      return sign * (x < y ? -1 : x > y ? 1 : 0);
    });
    [...line.children].forEach((th, n) =>
      th.setAttribute("aria-sort", n !== by ? "none" : down ? "descending" : "ascending"));
    draw();
  }
  columns.forEach((c, n) => {
    const th = make("th", undefined, c.kind || ""), button = make("button", c.head);
    button.addEventListener("click", () => { down = by === n ? !down : c.kind === "n"; by = n; arrange(); });
    th.append(button); line.append(th);
  });
  filter.addEventListener("input", () => { shown = PAGE; arrange(); });
  more.addEventListener("click", () => { shown += 10 * PAGE; draw(); });
  head.append(line); grid.append(head, rows); scroll.append(grid); body.append(tools, scroll, more);
  arrange();
}

const L = data.legs, T = data.track, V = data.vehicles, C = data.changes, Q = data.quality, R = data.verdicts, G = data.learnt;
const of = (column) => (k) => column[k];
const named = (column) => ({ head: "vehicle", value: (k) => names[column[k]], press: (k) => choose(column[k], true) });

function overloads() {
  const at = [];
  for (let k = 0; k < L.v.length; k++) if (L.level[k] === "alarm" || L.level[k] === "warn") at.push(k);
  const col = (column) => (k) => column[at[k]];
  table("overloads", at.length, [
    { head: "vehicle", value: (k) => names[L.v[at[k]]], press: (k) => choose(L.v[at[k]], true) },
    { head: "when, UTC", value: col(L.start), show: time, kind: "n" },
    { head: "mass, kg", value: col(L.mass_kg), kind: "n",
      show: (x, k) => pair(x, L.high95_kg[at[k]] - x) },
    { head: "permitted, kg", value: col(L.permitted_kg), show: (x) => number(x), kind: "n" },
    { head: "over by", value: (k) => L.mass_kg[at[k]] / L.permitted_kg[at[k]] - 1, show: percent, kind: "n" },
    { head: "how sure", value: col(L.overload), kind: "n", mark: (k) => [`${L.level[at[k]]}-text`],
      show: (x, k) => sure(x) + (L.coupled[at[k]] ? ", with trailer" : L.trailer[at[k]] ? ", trailer?" : "") },
  ], [5, true]);
}

function vehicles() {
  table("vehicles", names.length, [
    named(V.v),
    { head: "class", value: of(V.vehicle_class) },
    { head: "drives", value: of(V.drives), kind: "n" },
    { head: "km", value: of(V.distance_km), show: (x) => number(x), kind: "n" },
    { head: "mass known", value: of(V.known_share), show: percent, kind: "n" },
    { head: "t·km", value: of(V.tkm), kind: "n",
      show: (x, k) => pair(x, 1.96 * V.tkm_std[k]) },
    { head: "mean payload, kg", value: of(V.mean_payload_kg), kind: "n",
      show: (x, k) => pair(x, 1.96 * V.mean_payload_std_kg[k]) },
    { head: "empty", value: of(V.empty_share), show: percent, kind: "n" },
    { head: "overloads", value: (k) => 1e6 * V.alarms[k] + V.warnings[k], kind: "n",
      show: (x, k) => (V.worst_overload[k] === null ? "not judged" : `${V.alarms[k]} sure, ${V.warnings[k]} likely`), mark: (k) => (V.alarms[k] ? ["alarm-text"] : []) },
    { head: "load changes", value: of(V.changes), kind: "n" },
    { head: "last mass, kg", value: of(V.last_kg), kind: "n",
      show: (x, k) => pair(x, 1.96 * V.last_std_kg[k]) },
    { head: "file", value: of(V.has_file), show: (x) => (x ? "yes" : "none") },
  ], [8, true]);
}

function legs() {
  const half = (k) => L.high95_kg[k] - L.mass_kg[k];
  table("legs", L.v.length, [
    named(L.v),
    { head: "when, UTC", value: of(L.start), show: time, kind: "n" },
    { head: "km", value: of(L.distance_km), show: (x) => number(x), kind: "n" },
    { head: "mass, kg", value: of(L.mass_kg), show: (x, k) => pair(x, half(k)), kind: "n" },
    { head: "payload, kg", value: of(L.payload_kg), show: (x, k) => pair(x, half(k)), kind: "n" },
    { head: "overload", value: of(L.overload), show: sure, kind: "n",
      mark: (k) => (L.level[k] === "ok" || L.level[k] === null ? [] : [`${L.level[k]}-text`]) },
  ], [1, true]);
}

// A canvas as sharp as the screen; `draw` gets its context, width and height.
function board(parent, height, draw) {
  const canvas = make("canvas");
  parent.append(canvas);
  const paint = () => {
    const wide = canvas.clientWidth, sharp = window.devicePixelRatio || 1;
    if (!wide) return;
    canvas.style.height = `${height}px`;
    canvas.width = wide * sharp; canvas.height = height * sharp;
    const pen = canvas.getContext("2d");
    pen.scale(sharp, sharp);
    pen.font = "12px system-ui, sans-serif";
    draw(pen, wide, height);
  };
  new ResizeObserver(paint).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint);
  return { canvas, paint };
}

let chosen = 0, painted = [];
const legsOf = names.map(() => []);
L.v.forEach((v, k) => { if (L.start[k] !== null) legsOf[v].push(k); });
const spansOf = names.map(() => []);
T.v.forEach((v, k) => spansOf[v].push(k));

function choose(vehicle, go) {
  chosen = vehicle;
  picker.value = String(vehicle);
  for (const paint of painted) paint();
  if (go) document.getElementById("history").scrollIntoView({ behavior: "smooth" });
}

function state(leg) {
  const span = spansOf[L.v[leg]].find((k) => T.start[k] <= L.start[leg] && L.start[leg] <= T.end[k]);
  return span === undefined || T.state[span] === null ? "" : `; ${T.state[span]}`;
}

const picker = make("select");
function history() {
  const body = place("history"), tools = make("div", undefined, "tools"), label = make("label", "Vehicle ");
  names.forEach((name, k) => { const o = make("option", name); o.value = String(k); picker.append(o); });
  picker.addEventListener("change", () => choose(Number(picker.value)));
  label.append(picker); tools.append(label);
  const note = make("p", "", "note");
  body.append(tools);
  let spots = [];
  const { canvas, paint } = board(body, 320, (pen, wide, high) => {
    const at = legsOf[chosen], known = at.filter((k) => L.mass_kg[k] !== null);
    const left = 62, right = wide - 12, top = 14, bottom = high - 34;
    spots = [];
    pen.fillStyle = colour("--soft");
    note.textContent = `${at.length} legs, ${at.length - known.length} without a mass`;
    if (!known.length) { pen.fillText("no leg of this vehicle has a mass", left, high / 2); return; }
    const gross = V.gross_kg[chosen], tare = V.tare_kg[chosen];
    const ends = [...known.map((k) => L.high95_kg[k]), gross, 0].filter((x) => x !== null);
    const most = 1.05 * Math.max(...ends), each = (right - left) / at.length;
    const x = (n) => left + each * (n + 0.5);
    const y = (m) => bottom - (bottom - top) * m / most;
    const step = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20].find((s) => most / (1000 * s) <= 6) * 1000;
    pen.textAlign = "right"; pen.strokeStyle = colour("--line");
    for (let m = 0; m <= most; m += step) {
      pen.fillText(`${(m / 1000).toLocaleString("en")} t`, left - 6, y(m) + 4);
      pen.beginPath(); pen.moveTo(left, y(m)); pen.lineTo(right, y(m)); pen.stroke();
    }
    // Legs stand side by side: by the clock, a night would press them together.
    let free = 0, before = "";
    at.forEach((k, n) => {
      const day = time(L.start[k]).slice(0, 10);
      if (day !== before) {
        pen.beginPath(); pen.moveTo(x(n) - each / 2, top); pen.lineTo(x(n) - each / 2, bottom + 6); pen.stroke();
        if (x(n) >= free && x(n) < right - 60) { pen.textAlign = "left"; pen.fillText(day, x(n) - each / 2 + 3, high - 14); free = x(n) + 90; }
        before = day;
      }
    });
    pen.textAlign = "left"; pen.setLineDash([6, 4]);
    for (const [mass, text, ink] of [[gross, "permitted", "--alarm"], [tare, "empty", "--soft"]]) {
      if (mass === null) continue;
      pen.strokeStyle = pen.fillStyle = colour(ink);
      pen.beginPath(); pen.moveTo(left, y(mass)); pen.lineTo(right, y(mass)); pen.stroke();
      pen.fillText(text, left + 4, y(mass) - 4);
    }
    pen.setLineDash([]);
    // One load, over the legs between which no change was found.
    pen.lineWidth = 6; pen.globalAlpha = 0.3; pen.strokeStyle = colour("--soft");
    for (const k of spansOf[chosen]) {
      const first = at.findIndex((leg) => L.start[leg] >= T.start[k]);
      const last = at.findLastIndex((leg) => L.start[leg] <= T.end[k]);
      pen.beginPath(); pen.moveTo(x(first) - each / 2, y(T.mass_kg[k])); pen.lineTo(x(last) + each / 2, y(T.mass_kg[k])); pen.stroke();
    }
    pen.globalAlpha = 1; pen.lineWidth = 2;
    at.forEach((k, n) => {
      if (L.mass_kg[k] === null) return;
      const middle = x(n), height = y(L.mass_kg[k]);
      const level = L.level[k];
      pen.strokeStyle = pen.fillStyle = colour(level === "alarm" ? "--alarm" : level === "warn" ? "--warn" : "--blue");
      pen.beginPath(); pen.moveTo(middle, y(L.low95_kg[k])); pen.lineTo(middle, y(L.high95_kg[k])); pen.stroke();
      pen.beginPath();
      if (level === "alarm" || level === "warn") pen.rect(middle - 4, height - 4, 8, 8);
      else pen.arc(middle, height, 4, 0, 7);
      pen.fill();
      spots.push([middle, height, k]);
    });
    pen.lineWidth = 1;
  });
  canvas.addEventListener("pointermove", (event) => {
    const near = nearest(spots, event.offsetX, event.offsetY, 20);
    if (near === null) return;
    note.textContent = `${time(L.start[near])}: ${number(L.mass_kg[near])} kg, ${number(L.low95_kg[near])} to ` +
      `${number(L.high95_kg[near])} kg; payload ${number(L.payload_kg[near])} kg; ` +
      `${number(L.distance_km[near])} km; overload ${sure(L.overload[near])}${state(near)}`;
  });
  body.append(note);
  painted.push(paint);
}

function nearest(spots, x, y, reach) {
  let best = reach * reach, found = null;
  for (const [a, b, k] of spots) {
    const d = (a - x) ** 2 + (b - y) ** 2;
    if (d < best) { best = d; found = k; }
  }
  return found;
}

const KINDS = { loaded: ["--blue", 1], unloaded: ["--orange", -1], "trailer on": ["--purple", 1], "trailer off": ["--purple", -1] };

function map() {
  const body = place("map"), at = [];
  C.v.forEach((_, k) => { if (C.latitude_deg[k] !== null && C.longitude_deg[k] !== null) at.push(k); });
  if (!at.length) { body.append(make("p", "No position is known of a change of load.", "absent")); return; }
  let south = 90, north = -90, west = 180, east = -180;
  for (const k of at) {
    south = Math.min(south, C.latitude_deg[k]); north = Math.max(north, C.latitude_deg[k]);
    west = Math.min(west, C.longitude_deg[k]); east = Math.max(east, C.longitude_deg[k]);
  }
  const middle = (south + north) / 2, narrow = Math.cos(middle * Math.PI / 180), KM = 111.2;
  const east0 = (west + east) / 2, span = Math.max((north - south) * KM, (east - west) * KM * narrow, 0.5);
  let zoom = 1, shift = [0, 0], spots = [], only = false;
  const tools = make("div", undefined, "tools"), note = make("p", "", "note"), key = make("p", undefined, "key");
  const label = make("label"), box = make("input");
  box.type = "checkbox"; label.append(box, " only the vehicle of the history");
  for (const [sign, factor] of [["+", 1.6], ["−", 1 / 1.6]]) {
    const button = make("button", sign);
    button.setAttribute("aria-label", factor > 1 ? "nearer" : "farther");
    button.addEventListener("click", () => { scale(factor); });
    tools.append(button);
  }
  const whole = make("button", "whole");
  whole.addEventListener("click", () => { zoom = 1; shift = [0, 0]; paint(); });
  tools.append(whole, label);
  for (const [text, ink] of [["▲ loaded", "--blue"], ["▼ unloaded", "--orange"], ["▲▼ trailer on, off", "--purple"]]) {
    const mark = make("span", text); mark.style.color = `var(${ink})`; key.append(mark);
  }
  body.append(tools);
  const { canvas, paint } = board(body, 420, (pen, wide, high) => {
    const size = zoom * 0.9 * Math.min(wide, high) / span;
    spots = [];
    for (const k of at) {
      if (only && C.v[k] !== chosen) continue;
      const x = wide / 2 + shift[0] + (C.longitude_deg[k] - east0) * KM * narrow * size;
      const y = high / 2 + shift[1] - (C.latitude_deg[k] - middle) * KM * size;
      if (x < -9 || y < -9 || x > wide + 9 || y > high + 9) continue;
      const [ink, up] = KINDS[C.kind[k]];
      pen.fillStyle = colour.kept[ink] ??= colour(ink);
      pen.globalAlpha = 0.75;
      pen.beginPath(); pen.moveTo(x, y - 6 * up); pen.lineTo(x - 5, y + 4 * up); pen.lineTo(x + 5, y + 4 * up); pen.fill();
      spots.push([x, y, k]);
    }
    colour.kept = {};
    pen.globalAlpha = 1;
    const km = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((d) => d * size > 60) || 1000;
    pen.strokeStyle = pen.fillStyle = colour("--soft");
    pen.beginPath(); pen.moveTo(14, high - 22); pen.lineTo(14, high - 16); pen.lineTo(14 + km * size, high - 16);
    pen.lineTo(14 + km * size, high - 22); pen.stroke();
    pen.fillText(`${km} km, north is up`, 18, high - 24);
  });
  function scale(factor) { zoom *= factor; shift = shift.map((s) => s * factor); paint(); }
  box.addEventListener("change", () => { only = box.checked; paint(); });
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault(); scale(event.deltaY < 0 ? 1.2 : 1 / 1.2);
  }, { passive: false });
  let drag = null;
  canvas.addEventListener("pointerdown", (event) => { drag = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); point(event); });
  canvas.addEventListener("pointerup", () => { drag = null; });
  canvas.addEventListener("pointercancel", () => { drag = null; });
  canvas.addEventListener("pointermove", (event) => {
    if (drag) {
      shift = [shift[0] + event.clientX - drag[0], shift[1] + event.clientY - drag[1]];
      drag = [event.clientX, event.clientY]; paint();
    } else point(event);
  });
  function point(event) {
    const k = nearest(spots, event.offsetX, event.offsetY, 16);
    if (k === null) return;
    note.textContent = `${names[C.v[k]]}, ${time(C.time[k])}: ${C.kind[k]}, ${number(C.before_kg[k])} to ` +
      `${number(C.after_kg[k])} kg (${C.change_kg[k] > 0 ? "+" : ""}${pair(C.change_kg[k], 1.96 * C.std_kg[k])} kg)`;
  }
  body.append(key, note);
  painted.push(() => { if (only) paint(); });
}
colour.kept = {};

function quality() {
  const rank = { failed: 3, unread: 2, "no mass": 1, warning: 0 };
  table("quality", Q.v.length, [
    named(Q.v),
    { head: "what", value: (k) => rank[Q.kind[k]], show: (_, k) => Q.kind[k] },
    { head: "drives", value: of(Q.drives), kind: "n" },
    { head: "of all", value: of(Q.share), show: percent, kind: "n" },
    { head: "such as", value: of(Q.example), kind: "w" },
  ], [1, true]);
}

function learnt() {
  const rank = { contradicted: 5, drifts: 4, "never empty": 3, "not refined": 2, refined: 1, scaled: 0 };
  const spread = (x, std, digits) => (x === null ? "–" : `${x > 0 ? "+" : ""}${x.toFixed(digits)} ±\u00a0${(1.96 * std).toFixed(digits)}`);
  const drift = (head, name, std, digits) =>
    ({ head, value: of(G[name]), show: (x, k) => spread(x, G[std][k], digits), kind: "n" });
  table("learnt", G.v.length, [
    named(G.v),
    { head: "verdict", value: (k) => rank[G.verdict[k]], show: (_, k) => G.verdict[k],
      mark: (k) => (rank[G.verdict[k]] > 3 ? ["alarm-text"] : []) },
    drift("masses changed, %", "change_pct", "change_std_pct", 1),
    { head: "what was found", value: of(G.findings), kind: "w" },
    { head: "drives", value: of(G.drives), kind: "n" },
    drift("mean error, %", "error_pct", "error_std_pct", 1),
    drift("torque scale, %", "torque_drift_pct", "torque_drift_std_pct", 1),
    drift("rolling", "rolling_drift", "rolling_drift_std", 4),
    drift("pitch, deg", "pitch_drift_deg", "pitch_drift_std_deg", 2),
  ], [1, true]);
}

function verdicts() {
  const rank = { failed: 2, passed: 1, incomplete: 0 };
  table("verdicts", R.v.length, [
    named(R.v),
    { head: "verdict", value: (k) => rank[R.verdict[k]], show: (_, k) => R.verdict[k], mark: (k) => (R.verdict[k] === "failed" ? ["alarm-text"] : []) },
    { head: "known legs", value: of(R.legs), kind: "n" },
    { head: "45–55 %", value: of(R.worst_50), show: percent, kind: "n" },
    { head: "65–75 %", value: of(R.worst_70), show: percent, kind: "n" },
    { head: "90–100 %", value: of(R.worst_95), show: percent, kind: "n" },
    { head: "why", value: of(R.why), kind: "w" },
  ], [1, true]);
}

overloads(); vehicles(); history(); legs(); map(); quality(); learnt(); verdicts();
const worst = V.worst_overload.reduce((best, x, k) => ((x ?? -1) > (V.worst_overload[best] ?? -1) ? k : best), 0);
if (names.length) choose(worst);
document.body.dataset.ready = "yes";
