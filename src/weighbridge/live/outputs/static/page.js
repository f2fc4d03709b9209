"use strict";
// Shows what the server sends; asks for nothing else and sends nothing.

const WINDOW = 1800; // [s]
const MOST = 1800; // points
const OLD = 5000; // without news for so long, what is shown is old [ms]
const wide = matchMedia("(min-width: 60rem)");

const at = (id) => document.getElementById(id);
const put = (id, text) => {
  if (at(id).textContent !== text) at(id).textContent = text;
};
// With the sign that is as wide as a plus; never minus nought.
const whole = (value) => `${Math.round(value) + 0}`.replace("-", "−");
// Masses come in kg; the unit that people chose comes with them.
let unit = { name: "kg", per: 1 };
const mass = (value) => whole(value * unit.per);
const kg = (value) => (value === null ? "–" : `${mass(value)} ${unit.name}`);
const percent = (p) => {
  if (p === null) return "–";
  if (p > 0 && p < 0.01) return "< 1 %";
  if (p > 0.99 && p < 1) return "> 99 %";
  return `${Math.round(100 * p)} %`;
};
const duration = (s) => {
  if (s === null) return "–";
  return s < 120 ? `${Math.round(s)} s` : s < 7200 ? `${Math.round(s / 60)} min` : `${(s / 3600).toFixed(1)} h`;
};

// Points of the plot: never more than the window holds.
const points = { time: [], mass: [], low: [], high: [] };
const names = Object.keys(points);

function keep(more) {
  if (more.fresh) for (const n of names) points[n].length = 0;
  for (const n of names) points[n].push(...more[n]);
  const t = points.time;
  const begin = t.length ? t[t.length - 1] - WINDOW : 0;
  let out = Math.max(t.length - MOST, 0);
  while (out < t.length && t[out] < begin) out += 1;
  for (const n of names) points[n].splice(0, out);
  document.documentElement.dataset.points = t.length;
}

let plot = null;
let limit = null;

function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

function columns() {
  const t = points.time;
  const end = t.length ? t[t.length - 1] : 0;
  const x = t.map((v) => (v - end) / 60);
  const shown = (values) => values.map((m) => (m === null ? null : m * unit.per));
  return [x, ...[points.high, points.low, points.mass, t.map(() => limit)].map(shown)];
}

// The intervals at first are as wide as the plot is high: what is known later counts.
function range() {
  const known = points.mass.filter((m) => m !== null);
  let low = Math.min(...known);
  let high = Math.max(...known);
  const last = names.slice(2).map((n) => points[n][points[n].length - 1]);
  if (last[0] !== null && last[0] !== undefined) {
    low = Math.min(low, last[0]);
    high = Math.max(high, last[1]);
  }
  const near = limit !== null && limit < 1.25 * high && limit > 0.75 * low;
  if (near) {
    low = Math.min(low, limit);
    high = Math.max(high, limit);
  }
  at("limit-key").hidden = !near;
  const pad = Math.max(0.15 * (high - low), 0.02 * high);
  return [Math.max(low - pad, 0) * unit.per, (high + pad) * unit.per];
}

// Without a mass there is nothing to draw, and no axis that means anything.
function redraw() {
  const empty = !points.mass.some((m) => m !== null);
  for (const id of ["plot", "key"]) at(id).hidden = empty;
  at("no-points").hidden = !empty;
  if (empty) return;
  if (plot) plot.setData(columns());
  else draw();
}

function draw() {
  const box = at("plot");
  const axis = {
    stroke: colour("--soft"),
    grid: { stroke: colour("--line"), width: 1 },
    ticks: { stroke: colour("--line"), width: 1 },
    font: "13px system-ui, sans-serif",
  };
  if (plot) plot.destroy();
  plot = new uPlot(
    {
      width: box.clientWidth,
      height: box.clientHeight,
      padding: [6, 14, 0, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: { x: { time: false, range: [-WINDOW / 60, 0] }, y: { range } },
      axes: [
        { ...axis, incrs: [5, 10], size: 34, values: (u, v) => v.map((m) => (m ? `${whole(m)} min` : "now")) },
        { ...axis, size: 48, values: (u, v) => v.map((m) => `${m}`) },
      ],
      series: [
        {},
        { stroke: "transparent", points: { show: false } },
        { stroke: "transparent", points: { show: false } },
        { stroke: colour("--blue"), width: 2.5, points: { show: false } },
        { stroke: colour("--bad"), width: 2, dash: [8, 6], points: { show: false } },
      ],
      bands: [{ series: [1, 2], fill: colour("--band") }],
    },
    columns(),
    box,
  );
}

function needed(w) {
  // Without a number of minutes: never where the mass cannot get so sure, else not known.
  const never = (p) => w.reach_percent !== null && w.reach_percent >= p;
  // Rounded up, or it would look as if it did.
  const left = () => `not by driving on, vehicle file and sensors leave ± ${(Math.ceil(10 * w.reach_percent) / 10).toFixed(1)} %`;
  const one = (m, p) => {
    if (m === null) return `± ${p} %: ${never(p) ? left() : "not known yet"}`;
    if (m === 0) return `± ${p} %: reached`;
    return `± ${p} %: ${m < 1 ? "less than 1" : Math.round(m)} min more`;
  };
  const [five, two] = [w.minutes_to_5_percent, w.minutes_to_2_percent];
  if (five === null && two === null && !never(2)) return "time left not known yet";
  if (five === null && never(5)) return `± 5 %, ${one(two, 2)}`;
  return two === 0 ? one(two, 2) : `${one(five, 5)}, ${one(two, 2)}`;
}

function cell(row, text, kind) {
  const td = row.insertCell();
  td.textContent = text;
  if (kind) td.className = kind;
}

function showSignals(signals) {
  const fails = (s) => !s.fresh && !s.rests;
  const rows = [...signals].sort((a, b) => fails(b) - fails(a) || b.needed - a.needed);
  const body = at("signals");
  body.replaceChildren();
  for (const s of rows) {
    const row = body.insertRow();
    // A long name is broken after an underscore.
    cell(row, s.name.replaceAll("_", "_\u200b"));
    const rate = s.rate_hz <= 0.1 ? `1/${Math.round(1 / s.rate_hz)} s` : `${s.rate_hz.toFixed(1)} Hz`;
    cell(row, s.rate_hz ? rate : "–", "n");
    cell(row, s.age_s === null ? "–" : s.age_s < 100 ? `${Math.max(s.age_s, 0).toFixed(1)} s` : duration(s.age_s), "n");
    cell(row, s.late + s.unfit ? `${s.late + s.unfit}` : "", "n");
    const state = s.fresh ? "ok" : s.rests ? "rests" : s.age_s === null ? "absent" : "silent";
    cell(row, state, s.fresh ? "ok" : s.rests ? "soft" : s.needed ? "silent needed" : "silent");
  }
  const wrong = rows.filter(fails);
  const brief = `${rows.filter((s) => s.fresh).length} of ${rows.length} come`;
  put("signals-brief", wrong.length ? `${brief}; not: ${wrong.map((s) => s.name).join(", ")}` : brief);
  at("signals-brief").classList.toggle("wrong", wrong.some((s) => s.needed));
}

// Before the first mass the signals are the news; on a narrow page they are folded after it.
let known = null;

function unfold(now) {
  if (now === known) return;
  if (known === null || !wide.matches) at("signals-box").open = wide.matches || !now;
  known = now;
}

function show(w) {
  unfold(w.mass_kg !== null);
  document.title = `${known ? kg(w.mass_kg) : w.status}, ${w.vehicle}`;
  put("vehicle", w.vehicle);
  put("status", w.status);
  at("status").className = `status ${w.status}`;
  at("parked").hidden = !w.parked;
  document.body.classList.toggle("inconsistent", w.status === "inconsistent");
  put("mass", known ? mass(w.mass_kg) : "–");
  put("unit", unit.name);
  put("plot-unit", unit.name);
  const [low, high] = w.interval95_kg || [null, null];
  put("interval", low === null ? "no mass yet" : `± ${kg((high - low) / 2)}: ${mass(low)} to ${kg(high)} with 95 %`);
  put("reason", w.reason);
  put("payload-name", w.tared_kg === null ? "Payload" : "Payload since the tare");
  put("payload", kg(w.payload_kg));
  // Without a permitted mass a limit of the command takes its place.
  const above = w.alerts.find((a) => a.side === "above");
  const watched = w.permitted_kg === null && above !== undefined;
  at("overload-box").hidden = w.permitted_kg === null && !watched;
  at("no-limit").hidden = w.permitted_kg !== null || watched;
  put("overload-name", watched ? `Above ${kg(above.limit_kg)}` : "Overload probability");
  put("overload", percent(watched ? above.probability : w.overload_probability));
  put("driven", duration(w.driven_s));
  at("load").hidden = w.share_of_permitted === null;
  if (w.share_of_permitted !== null) {
    const p = w.overload_probability;
    put("share", `${Math.round(100 * w.share_of_permitted)} %`);
    at("share-bar").value = Math.min(w.share_of_permitted, 1);
    at("share-bar").className = p >= 0.5 ? "bad" : p >= 0.05 ? "fair" : "";
  }
  // What is wrong stands first: each limit that is passed, and how sure that is.
  const passed = w.alerts.filter((a) => a.active);
  at("alert").hidden = !passed.length;
  put("alert", passed.map((a) => `${a.limit_kg === w.permitted_kg ? "Overload" : "Alert"}: ${a.side} ${kg(a.limit_kg)}, ${percent(a.probability)} sure`).join("; "));
  limit = watched ? above.limit_kg : w.permitted_kg;
  put("limit-name", watched ? "limit" : "permitted");
  at("look").hidden = w.look === null;
  if (w.look !== null) {
    put("look-share", `${Math.round(100 * w.look)} %`);
    at("look-bar").value = w.look;
  }
  const reached = w.progress_to_5 >= 1;
  const part = reached ? w.progress : w.progress_to_5 || 0;
  put("wanted", `Of what ± ${reached ? 2 : 5} % needs`);
  put("learnt", `${Math.round(100 * part)} %`);
  at("learnt-bar").value = part;
  put("needed", needed(w));
  put("advice", w.advice);
  showSignals(w.signals);
  at("notes-box").hidden = !w.notes.length;
  const list = w.notes.map((note) => {
    const item = document.createElement("li");
    item.textContent = note;
    return item;
  });
  at("notes").replaceChildren(...list.reverse());
}

let heard = 0;
let waiting = null;

function take(event) {
  const news = JSON.parse(event.data);
  heard = Date.now();
  unit = news.unit;
  waiting = news;
  keep(news.points);
  // A page in the background draws when it is looked at again.
  requestAnimationFrame(() => {
    if (waiting === null) return;
    const weighing = waiting.weighing;
    waiting = null;
    show(weighing);
    redraw();
    look();
  });
}

function look() {
  const old = Date.now() - heard > OLD;
  document.body.classList.toggle("old", old);
  at("link").hidden = !old;
  if (old && heard) {
    put("link", `No news for ${duration((Date.now() - heard) / 1000)}: what is shown is old.`);
  }
}

function listen() {
  const source = new EventSource("events");
  source.onmessage = take;
  source.onerror = () => {
    // The browser tries again by itself unless it was refused.
    if (source.readyState === EventSource.CLOSED) setTimeout(listen, 3000);
  };
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plot && draw());
new ResizeObserver(() => {
  const box = at("plot");
  if (plot && box.clientWidth) plot.setSize({ width: box.clientWidth, height: box.clientHeight });
}).observe(at("plot"));
setInterval(look, 1000);
listen();
