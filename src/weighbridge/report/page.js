"use strict";
// Figures are drawn when their section is first open, so that a page of many drives opens at once.
const figures = JSON.parse(document.getElementById("figures").textContent);
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const printing = window.matchMedia("print");
// The buttons are named so that none is among them that would send data anywhere.
const settings = {
  responsive: true,
  displaylogo: false,
  displayModeBar: "hover",
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]],
};

function colours() {
  const night = dark.matches && !printing.matches;
  return {
    "font.color": night ? "#d5dbe1" : "#3a4450",
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
  };
}

function draw(place) {
  if (place.dataset.drawn) return;
  place.dataset.drawn = "yes";
  const figure = figures[place.id];
  const now = colours();
  // On a telephone the legend takes lines of its own, which the plot gets back in height.
  const narrow = place.clientWidth < 480;
  const layout = Object.assign({}, figure.layout, {
    font: Object.assign({}, figure.layout.font, { color: now["font.color"] }, narrow && { size: 11 }),
    height: figure.layout.height * (narrow ? 1.15 : 1),
    paper_bgcolor: now.paper_bgcolor,
    plot_bgcolor: now.plot_bgcolor,
    autosize: true,
  });
  Plotly.newPlot(place, figure.data, layout, settings);
}

function drawOpen() {
  for (const place of document.querySelectorAll(".plot")) {
    const section = place.closest("details");
    if (!section || section.open) draw(place);
  }
}

function repaint() {
  for (const place of document.querySelectorAll(".plot[data-drawn]")) Plotly.relayout(place, colours());
}

for (const section of document.querySelectorAll("details")) section.addEventListener("toggle", drawOpen);
dark.addEventListener("change", repaint);
printing.addEventListener("change", repaint);
// Paper does not tell figures its width, so they are set to that of A4 within its margins.
window.addEventListener("beforeprint", () => {
  for (const section of document.querySelectorAll("details")) section.open = true;
  drawOpen();
  for (const place of document.querySelectorAll(".plot")) {
    const height = 0.75 * figures[place.id].layout.height;
    Plotly.relayout(place, { autosize: false, width: 660, height });
  }
});
window.addEventListener("afterprint", () => {
  for (const place of document.querySelectorAll(".plot")) {
    Plotly.relayout(place, { autosize: true, width: null, height: figures[place.id].layout.height });
  }
});
drawOpen();
