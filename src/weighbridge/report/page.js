"use strict";
// Figures are drawn when they come near the window, so that a page of many drives opens at once.
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const touch = window.matchMedia("(pointer: coarse)");
// Widths of paper: figures cannot ask for that of A4 within its margins before it is laid out.
const PAPER = { whole: 700, half: 340 };
const NARROW = 480;
// The buttons are named so that none is among them that would send data anywhere.
const settings = {
  responsive: true,
  displaylogo: false,
  displayModeBar: "hover",
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]],
};
const places = [...document.querySelectorAll(".plot")];
let figures = {};

async function unpack(id) {
  const text = document.getElementById(id).textContent;
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).text();
}

function isShown(place) {
  return !place.closest("details:not([open])");
}

function textColour(onPaper) {
  return dark.matches && !onPaper ? "#d5dbe1" : "#3a4450";
}

function layoutOf(place, onPaper) {
  const given = structuredClone(figures[place.id].layout); // the library writes into it
  const narrow = onPaper ? !isWide(place) : place.clientWidth < NARROW;
  const layout = {
    ...given,
    font: { ...given.font, color: textColour(onPaper) },
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    autosize: true,
  };
  if (narrow) {
    layout.font.size = 11;
    layout.margin = { ...given.margin, l: 46, r: 8, b: 42 };
    // Lines of the legend that a wide figure has not are given back to the plot.
    layout.height = given.height * 1.1;
  }
  if (touch.matches) layout.dragmode = false; // a finger scrolls the page
  if (onPaper) {
    layout.autosize = false;
    layout.width = isWide(place) ? PAPER.whole : PAPER.half;
    layout.height = Math.min(0.66 * given.height, 270);
    layout.font.size = 9;
  }
  return layout;
}

function isWide(place) {
  return place.parentElement.classList.contains("wide");
}

function tracesOf(place, onPaper) {
  const narrow = onPaper || place.clientWidth < NARROW;
  return figures[place.id].data.map((trace) => {
    const drawn = { ...trace };
    if (narrow && trace.meta && trace.meta.short) drawn.name = trace.meta.short;
    const bar = trace.marker && trace.marker.colorbar;
    if (narrow && bar) drawn.marker = { ...trace.marker, colorbar: { ...bar, thickness: 8, xpad: 4 } };
    return drawn;
  });
}

function draw(place, onPaper = false) {
  if (!(place.id in figures)) return;
  place.dataset.drawn = onPaper ? "paper" : "screen";
  const shown = place.clientWidth < NARROW ? { ...settings, displayModeBar: false } : settings;
  Plotly.react(place, tracesOf(place, onPaper), layoutOf(place, onPaper), shown);
}

// Arrows move along the axis, + and - zoom, 0 shows all.
function steer(event) {
  const place = event.currentTarget;
  const axis = place.layout && place.layout.xaxis;
  if (!axis || !axis.range || event.ctrlKey || event.altKey || event.metaKey) return;
  const [low, high] = axis.range.map(Number);
  const span = high - low;
  const middle = 0.5 * (low + high);
  const moved = {
    ArrowLeft: [low - 0.2 * span, high - 0.2 * span],
    ArrowRight: [low + 0.2 * span, high + 0.2 * span],
    "+": [middle - span / 3, middle + span / 3],
    "-": [middle - 0.75 * span, middle + 0.75 * span],
  }[event.key];
  if (moved) Plotly.relayout(place, { "xaxis.range": moved });
  else if (event.key === "0") draw(place);
  else return;
  event.preventDefault();
}

function repaint() {
  for (const place of places) {
    if (place.dataset.drawn) Plotly.relayout(place, { "font.color": textColour(false) });
  }
}

function toPaper() {
  for (const place of places) if (isShown(place)) draw(place, true);
}

function toScreen() {
  for (const place of places) if (place.dataset.drawn === "paper") draw(place);
}

async function begin() {
  if (!places.length) return;
  if (!("DecompressionStream" in window)) {
    document.getElementById("old").hidden = false;
    return;
  }
  const [library, data] = await Promise.all([unpack("library"), unpack("figures")]);
  const script = document.createElement("script");
  script.textContent = library;
  document.head.append(script);
  figures = JSON.parse(data);
  const near = new IntersectionObserver(
    (entries) => {
      for (const { target, isIntersecting } of entries) {
        if (isIntersecting && !target.dataset.drawn) draw(target);
      }
    },
    { rootMargin: "300px" },
  );
  for (const place of places) {
    near.observe(place);
    place.addEventListener("keydown", steer);
  }
  dark.addEventListener("change", repaint);
  window.addEventListener("beforeprint", toPaper);
  window.addEventListener("afterprint", toScreen);
}

begin();
