// SPDX-License-Identifier: Apache-2.0
// Draws every figure from the numbers that the page carries, in the colours of the theme.
// Says "drawn" to the document each time it has drawn them all.
"use strict";
const report = JSON.parse(document.getElementById("report").textContent);
const plots = [...document.querySelectorAll(".plot")];
const figures = Object.fromEntries(
  report.chapters.flatMap((chapter) => chapter.items)
    .filter((item) => item.kind === "figure")
    .map((item) => [item.key, item.content]),
);
const coarse = matchMedia("(pointer: coarse)").matches;
// figures with one cursor over all: no pointer of their own, and zoomed in time only
const linked = document.documentElement.dataset.figures === "linked";
// figures that are drawn again and again: what a reader has zoomed stays so
const growing = document.documentElement.dataset.figures === "growing";
const dark = matchMedia("(prefers-color-scheme: dark)");
const FONT = { family: "system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif", size: 13 };
const WIDTH = { line: 2, dashes: 2, over: 2.2, dots: 2.5, step: 1.6, bars: 1.2, band: 8 };
const DASH = { dashes: "7px,5px", over: "8px,8px", dots: "2px,5px" };
const LAYER = { band: 0, dashes: 0, bars: 0, cloud: 0, line: 1, step: 1, over: 2, dots: 2, marks: 3 };
const SYMBOL = { thesis: "diamond", otis: "square" };

const colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

function trace(series, unit) {
  const paint = colour(series.role);
  const common = { x: series.x, y: series.y, name: series.name, zorder: LAYER[series.shape] };
  if (series.shape === "marks") {
    return {
      ...common, mode: "markers", text: series.texts, cliponaxis: false,
      hovertemplate: "%{text}<extra></extra>",
      marker: {
        color: paint, size: 11, symbol: SYMBOL[series.role] || "circle",
        line: { color: colour("panel"), width: 1.5 },
      },
    };
  }
  if (series.shape === "cloud") {
    return {
      ...common, mode: "markers", text: series.texts, type: "scattergl", opacity: 0.5,
      hovertemplate: "%{text}<extra></extra>", marker: { color: paint, size: 4 },
    };
  }
  // a line of one point would not be seen
  const alone = series.y.filter((y) => y !== null).length === 1;
  return {
    ...common, mode: alone ? "markers" : "lines", marker: { color: paint, size: 7 }, opacity: series.shape === "band" ? 0.4 : 1,
    hovertemplate: `%{y} ${unit}`, fill: series.shape === "bars" ? "tozeroy" : "none",
    line: {
      color: paint, width: WIDTH[series.shape], dash: DASH[series.shape] || "solid",
      shape: ["step", "bars"].includes(series.shape) ? "hv" : "linear",
    },
  };
}

function extent(figure) {
  if (figure.x.span) return figure.x.span;
  const xs = [
    ...figure.series.flatMap((series) => series.x.filter((_, i) => series.y[i] !== null)),
    ...figure.instants.map((instant) => instant.at),
  ];
  const low = Math.min(...xs), high = Math.max(...xs);
  return [low - 0.015 * (high - low), high + 0.025 * (high - low)];
}

const pen = document.createElement("canvas").getContext("2d");
const ROWS = 5, ROW = 16;

// the side of its line and the row of each word, so that none is cropped or lies over another;
// null: there is no room for it
function placed(plot, instants, [low, high]) {
  pen.font = `${FONT.size}px ${FONT.family}`;
  // less what numbers of the vertical axis take
  const width = plot.clientWidth - 76;
  const ends = Array(ROWS).fill(-Infinity);
  return instants.map(({ at, text }) => {
    if (!text) return null;
    const x = width * (at - low) / (high - low), size = pen.measureText(text).width + 8;
    for (let row = 0; row < ROWS; row++) {
      const sides = [["left", x, x + size], ["right", x - size, x]];
      const side = sides.find(([, begin, end]) => begin >= Math.max(ends[row], -30) && end <= width + 8);
      if (side) {
        ends[row] = side[2];
        return { xanchor: side[0], yshift: row * ROW };
      }
    }
    return null;
  });
}

// as many numbers below a plot as there is room for
function ticks(plot, [low, high]) {
  const decimals = Math.max(0, Math.ceil(-Math.log10((high - low) / 6 || 1)));
  const whole = Math.max(1, Math.ceil(Math.log10(Math.max(Math.abs(low), Math.abs(high), 1))));
  const letters = whole + Math.floor((whole - 1) / 3) + (decimals && decimals + 1) + (low < 0);
  const room = Math.floor((plot.clientWidth - 60) / (7.3 * letters + 14));
  return Math.max(2, Math.min(growing ? 4 : innerWidth > 700 ? 8 : 6, room));
}

function layout(plot, figure) {
  const range = extent(figure);
  const quiet = colour("quiet");
  const axis = {
    gridcolor: colour("faint"), linecolor: colour("edge"), zeroline: false, automargin: true,
    tickfont: { ...FONT, color: quiet }, fixedrange: coarse, ticks: "outside",
    tickcolor: colour("edge"), ticklen: 4, exponentformat: "none", separatethousands: true,
  };
  const vertical = figure.y.log
    ? { type: "log", dtick: 1, ...(figure.y.span && { range: figure.y.span.map(Math.log10) }) }
    : { nticks: 7, ...(figure.y.span && { range: figure.y.span }) };
  // of a map both axes show more than asked for, never less
  const map = figure.stretch && { scaleanchor: "x", scaleratio: figure.stretch };
  const places = placed(plot, figure.instants, range);
  const rows = Math.max(0, ...places.map((place) => place ? place.yshift : 0));
  const word = { showarrow: false, font: { ...FONT, color: quiet }, borderpad: 1 };
  return {
    font: { ...FONT, color: colour("ink") },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    margin: { l: 44, r: 10, t: 22 + rows, b: 26 }, showlegend: false,
    dragmode: coarse ? false : "zoom", uirevision: growing,
    hovermode: linked ? false : innerWidth > 700 ? "x unified" : "closest",
    hoverlabel: {
      bgcolor: colour("panel"), bordercolor: colour("edge"), font: { ...FONT, color: colour("ink") },
      namelength: -1,
    },
    xaxis: { ...axis, range, showgrid: false, nticks: ticks(plot, range), hoverformat: ".2f" },
    yaxis: { ...axis, ...vertical, ...map, ...(linked && !map && { fixedrange: true }) },
    shapes: [
      ...figure.instants.map((instant) => ({
        type: "line", x0: instant.at, x1: instant.at, yref: "paper", y0: 0, y1: 1, layer: "below",
        line: { color: quiet, width: 1, dash: "2px,3px" },
      })),
      ...figure.levels.map((level) => ({
        type: "line", y0: level.at, y1: level.at, xref: "paper", x0: 0, x1: 1, layer: "below",
        line: { color: quiet, width: 1.2, dash: "6px,4px" },
      })),
    ],
    annotations: [
      ...figure.instants.map((instant, i) => ({
        ...word, text: instant.text, x: instant.at, yref: "paper", y: 1, yanchor: "bottom",
        visible: places[i] !== null, ...places[i],
      })),
      ...figure.levels.map((level) => ({
        ...word, text: level.text, xref: "paper", x: 1, xanchor: "right", yanchor: "bottom",
        y: figure.y.log ? Math.log10(level.at) : level.at, bgcolor: colour("panel"), opacity: 0.9,
      })),
    ],
  };
}

// what grows has no axes before it has a line
const begun = (figure) => figure.series.some(({ y }) => y.filter((one) => one !== null).length > 1);

function draw(plot) {
  const figure = figures[plot.dataset.key];
  if (growing && !plot.data && !begun(figure)) return null;
  const data = figure.series.map((series) => trace(series, figure.y.unit));
  const buttons = [...plot.closest(".item").querySelectorAll(".legend button")];
  buttons.forEach((button, i) => {
    data[i].visible = button.getAttribute("aria-pressed") === "true";
  });
  return Plotly.react(plot, data, layout(plot, figure), { displayModeBar: false, responsive: true });
}

async function drawAll() {
  if (!window.Plotly) return;
  for (const plot of plots) {
    await draw(plot);
    await new Promise((resume) => setTimeout(resume));
  }
  document.documentElement.dataset.drawn = String(plots.length);
  document.dispatchEvent(new Event("drawn"));
}

// the library that draws lies compressed in the page
async function unpack() {
  const packed = document.getElementById("plotly");
  const bytes = Uint8Array.from(atob(packed.textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  const script = document.createElement("script");
  script.textContent = await new Response(stream).text();
  document.head.append(script);
  packed.remove();
}

async function begin() {
  if (document.getElementById("plotly")) {
    if (!("DecompressionStream" in window)) {
      document.getElementById("too-old").hidden = false;
      return;
    }
    await unpack();
  }
  await drawAll();
}

document.querySelectorAll(".legend button").forEach((button) => {
  button.addEventListener("click", () => {
    button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
    draw(button.closest(".item").querySelector(".plot"));
  });
});

// theme: that of the system until the button is pressed
const toggle = document.querySelector(".theme");
const isDark = () => (document.documentElement.dataset.theme || (dark.matches ? "dark" : "light")) === "dark";
const label = () => { toggle.textContent = isDark() ? "Light" : "Dark"; };
toggle.hidden = false;
toggle.addEventListener("click", () => {
  document.documentElement.dataset.theme = isDark() ? "light" : "dark";
  label();
  drawAll();
});
dark.addEventListener("change", () => { label(); drawAll(); });
label();

// the contents: closed after a choice on a small screen, and marked where the reader is
const contents = document.querySelector(".toc details");
if (contents) {
  const wide = matchMedia("(min-width: 68.01rem)");
  const unfold = () => { contents.open = wide.matches; };
  wide.addEventListener("change", unfold);
  unfold();
  contents.addEventListener("click", (event) => {
    if (event.target.closest("a") && !wide.matches) contents.open = false;
  });
}
const links = new Map(
  [...document.querySelectorAll(".toc .places a")].map((link) => [link.hash.slice(1), link]),
);
const watcher = new IntersectionObserver(
  (entries) => entries.forEach((entry) => {
    const link = links.get(entry.target.id);
    if (link) link.classList.toggle("here", entry.isIntersecting);
  }),
  { rootMargin: "-20% 0px -60% 0px" },
);
document.querySelectorAll(".item").forEach((item) => watcher.observe(item));

begin();
