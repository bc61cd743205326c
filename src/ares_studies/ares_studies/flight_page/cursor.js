// SPDX-License-Identifier: Apache-2.0
// One time for all: the cursor of every chart, the numbers beside the legends, the vehicle.
const FIRST = Math.min(...EARTH.flights.map((flight) => flight.time_s[0]));
const LAST = Math.max(...EARTH.flights.map((flight) => flight.time_s.at(-1)));
/* the whole flight is played in so many seconds */
const PLAYED_IN = 20;
const slider = document.querySelector(".transport .time");
const clock = document.querySelector(".transport .now");
const playButton = document.querySelector(".transport .play");
const places = document.querySelector(".place");
// where all flights still have numbers
let now = Math.min(...EARTH.flights.map((flight) => flight.time_s.at(-1)));

const charts = plots.map((plot) => {
  const figure = figures[plot.dataset.key];
  const outputs = [...plot.closest(".item").querySelectorAll(".legend button")].map((button) => {
    const output = document.createElement("output");
    button.append(output);
    return output;
  });
  // a line where x is the time, else a dot on each way
  const ways = figure.series.filter((series) => series.t.length);
  const lines = (ways.length ? ways : [null]).map((series) => {
    const line = document.createElement("div");
    line.className = series ? `dot ${series.role}` : "cursor";
    line.hidden = true;
    return line;
  });
  return { plot, figure, outputs, ways, lines, digits: decimals(figure) };
});

// four figures of what the lines of a chart span
function decimals({ series, y: { log } }) {
  if (log) return null;
  const values = series.flatMap((one) => one.y.filter((y) => y !== null));
  const span = Math.max(...values) - Math.min(...values);
  if (values.every(Number.isInteger)) return 0;
  return span > 0 ? Math.max(0, Math.min(7, 3 - Math.floor(Math.log10(span)))) : 3;
}

function valueAt(series, t, values = series.y) {
  const times = series.t.length ? series.t : series.x;
  // the ends of the slider are rounded
  if (t < times[0] - 0.01 || t > times.at(-1) + 0.01) return null;
  const [i, share] = place(times, t);
  const here = values[i];
  if (series.shape === "step" || share === 0 || here === null) return here;
  const next = values[i + 1];
  return next === null ? null : here + share * (next - here);
}

function shown(value, digits) {
  if (value === null) return "–";
  const text = digits === null
    ? value.toLocaleString("en", { maximumSignificantDigits: 4 })
    : value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits });
  return text.replace("-", "−");
}

function placeText(flight) {
  const [i, share] = place(flight.time_s, now);
  const j = Math.min(i + 1, flight.time_s.length - 1);
  const mix = (list) => list[i] + share * (list[j] - list[i]);
  let turn = flight.longitude_deg[j] - flight.longitude_deg[i];
  turn -= 360 * Math.round(turn / 360);
  const longitude = ((flight.longitude_deg[i] + share * turn + 540) % 360) - 180;
  const latitude = mix(flight.latitude_deg);
  const way = flight.ways.find(({ first, last }) => i >= first && i < last) || flight.ways.at(-1);
  return `${way.name}, over ${Math.abs(latitude).toFixed(2)}° ${latitude < 0 ? "S" : "N"}, `
    + `${Math.abs(longitude).toFixed(2)}° ${longitude < 0 ? "W" : "E"}`;
}

function updateChart({ plot, figure, outputs, ways, lines, digits }) {
  figure.series.forEach((series, i) => {
    // the coast of a map has no time
    if (ways.length && !series.t.length) return;
    const value = valueAt(series, now);
    outputs[i].textContent = shown(value, digits) + (value === null ? "" : ` ${figure.y.unit}`);
  });
  const axis = plot._fullLayout && plot._fullLayout.xaxis;
  if (!axis) return;
  if (ways.length) {
    ways.forEach((way, i) => putDot(plot, way, lines[i]));
    return;
  }
  const [line] = lines;
  const at = axis.l2p(now);
  const size = plot._fullLayout._size;
  line.hidden = !(at >= -0.5 && at <= axis._length + 0.5);
  line.style.transform = `translateX(${axis._offset + at}px)`;
  line.style.top = `${size.t}px`;
  line.style.height = `${size.h}px`;
}

// where a way is by now
function putDot(plot, way, dot) {
  const { xaxis, yaxis } = plot._fullLayout;
  const x = valueAt(way, now, way.x), y = valueAt(way, now);
  const across = x === null ? NaN : xaxis.l2p(x), down = y === null ? NaN : yaxis.l2p(y);
  dot.hidden = !(across >= 0 && across <= xaxis._length && down >= 0 && down <= yaxis._length);
  dot.style.transform = `translate(${xaxis._offset + across}px, ${yaxis._offset + down}px)`;
}

let waiting = false;
function setTime(t) {
  now = Math.max(FIRST, Math.min(LAST, t));
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    update();
  });
}

function update() {
  slider.value = String((now - FIRST) / (LAST - FIRST || 1));
  clock.textContent = `${shown(now, 2)} s`;
  document.documentElement.dataset.time = String(now);
  globe.show(now);
  charts.forEach(updateChart);
  EARTH.flights.forEach((flight, i) => {
    places.children[i].lastChild.textContent = placeText(flight);
  });
}

for (const flight of EARTH.flights) {
  const box = document.createElement("div");
  const term = document.createElement("dt");
  term.textContent = EARTH.flights.length > 1 ? flight.name : "vehicle";
  box.append(term, document.createElement("dd"));
  places.append(box);
}

// playing: the same speed on every screen, from the beginning if at the end
let playing = 0;
function play(from) {
  let before = from;
  const step = (at) => {
    if (playing === 0) return;
    now += ((at - before) / 1000) * ((LAST - FIRST) / PLAYED_IN);
    before = at;
    setTime(now);
    if (now >= LAST) pause();
    else playing = requestAnimationFrame(step);
  };
  playing = requestAnimationFrame(step);
}

function pause() {
  cancelAnimationFrame(playing);
  playing = 0;
  playButton.textContent = "Play";
  playButton.setAttribute("aria-pressed", "false");
}

playButton.addEventListener("click", () => {
  if (playing) {
    pause();
    return;
  }
  if (now >= LAST) now = FIRST;
  playButton.textContent = "Pause";
  playButton.setAttribute("aria-pressed", "true");
  play(performance.now());
});
slider.addEventListener("input", () => {
  pause();
  setTime(FIRST + Number(slider.value) * (LAST - FIRST));
});
document.querySelectorAll("[data-time]").forEach((button) => {
  if (button.tagName !== "BUTTON") return;
  button.addEventListener("click", () => {
    pause();
    setTime(Number(button.dataset.time));
  });
});

// the pointer over any chart
function follow({ plot, ways }) {
  const look = (event) => {
    const axis = plot._fullLayout && plot._fullLayout.xaxis;
    if (!axis || (event.pointerType === "touch" && event.type === "pointerdown")) return;
    const frame = plot.getBoundingClientRect();
    const along = event.clientX - frame.left - axis._offset;
    if (along < 0 || along > axis._length) return;
    pause();
    setTime(ways.length ? nearestTime(plot, ways, along, event.clientY - frame.top) : axis.p2l(along));
  };
  plot.addEventListener("pointermove", look, { passive: true });
  plot.addEventListener("click", look);
}

// when a way is nearest to a place
function nearestTime(plot, ways, along, height) {
  const { xaxis, yaxis } = plot._fullLayout;
  let least = Infinity, time = now;
  for (const { x, y, t } of ways) {
    t.forEach((at, i) => {
      if (x[i] === null || y[i] === null) return;
      const away = Math.hypot(xaxis.l2p(x[i]) - along, yaxis.l2p(y[i]) + yaxis._offset - height);
      if (away < least) [least, time] = [away, at];
    });
  }
  return time;
}

// a zoom of one chart in time is a zoom of all
const timed = charts.filter(({ ways }) => !ways.length).map(({ plot }) => plot);
let zooming = false;
function link(plot) {
  plot.on("plotly_relayout", async (change) => {
    if (zooming || !Object.keys(change).some((key) => key.startsWith("xaxis."))) return;
    if (!timed.includes(plot)) {
      update();
      return;
    }
    zooming = true;
    const range = change["xaxis.autorange"] ? null : [...plot._fullLayout.xaxis.range];
    for (const other of timed) {
      await Plotly.relayout(other, { "xaxis.range": [...(range || figures[other.dataset.key].x.span)] });
    }
    zooming = false;
    update();
  });
}

document.addEventListener("drawn", () => {
  for (const chart of charts) {
    if (chart.lines[0].isConnected) continue;
    chart.plot.append(...chart.lines);
    follow(chart);
    link(chart.plot);
  }
  update();
});
addEventListener("resize", () => setTime(now));
update();
