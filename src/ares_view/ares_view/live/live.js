// SPDX-License-Identifier: Apache-2.0
// Follows a flight: what the server tells becomes numbers, lines, ways over the Earth.
/* wall time in s without an update after which what is shown is not called live */
const STALE = 1;
/* wall time in ms between drawings of a chart, and between tries to connect */
const CHART_PERIOD = 200;
const RETRY_PERIOD = 1000;
/* the same for gauges and globe, and for charts, of a flight that goes as fast as its nodes
   answer: what draws here would take from their processors */
const HURRIED_PERIOD = 500;
const HURRIED_CHART_PERIOD = 2000;
const byId = (id) => document.getElementById(id);
const playButton = document.querySelector(".controls .play");
const paceButtons = [...document.querySelectorAll("[data-pace]")];
const gauges = [...document.querySelectorAll(".gauge")];
const signs = [...byId("signs").content.children];
const LAND = globe.land;

// rows that the server keeps, in their order: number and values
class Rows {
  constructor(fields) {
    this.at = Object.fromEntries(fields.map((name, i) => [name, i]));
    this.rows = [];
  }

  // as the server thins: the last row stays, of the others those at multiples of the stride
  add(rows, stride) {
    if (rows.length === 0) return;
    this.rows = [...this.rows.filter(([number]) => number % stride === 0), ...rows];
  }

  column(field) { return this.rows.map(([, row]) => row[this.at[field]]); }

  last(field) {
    const row = this.rows.at(-1);
    return row && field in this.at ? row[1][this.at[field]] : null;
  }
}

const live = {
  about: null, states: new Rows(report.states), statuses: new Rows(report.statuses),
  events: [], most: {}, updates: 0, frames: 0, heard: 0, age: null, connected: false, over: false,
};

// ---- what the server says

function take(message) {
  live.heard = performance.now();
  if (message.kind === "refused") {
    byId("answer").textContent = message.reason;
    return;
  }
  if (message.kind === "end") {
    live.over = true;
    if (live.about) showAfter();
    return;
  }
  live.age = message.age_s;
  if (message.kind === "beat") return;
  live.updates += 1;
  if (message.kind === "flight") {
    live.states = new Rows(report.states);
    live.statuses = new Rows(report.statuses);
    live.events = [];
    live.most = {};
  }
  live.states.add(message.states, message.strides[0]);
  live.statuses.add(message.statuses, message.strides[1]);
  noteMost(live.states, message.states);
  noteMost(live.statuses, message.statuses);
  live.events.push(...message.events);
  if (message.complaints) byId("complaints").replaceChildren(...message.complaints.map(complaint));
  if (message.about) {
    live.about = message.about;
    showAbout();
  }
  if (message.about || message.events.length) showTimeline();
  changed();
}

// the greatest size of what a bar is measured by
function noteMost({ at }, rows) {
  for (const { dataset: { key, full } } of gauges) {
    if (!["most", "limit"].includes(full) || !(key in at)) continue;
    for (const [, row] of rows) live.most[key] = Math.max(live.most[key] || 0, Math.abs(row[at[key]] || 0));
  }
}

function element(name, text, kind) {
  const made = document.createElement(name);
  made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

const figuresOf = (value, digits) => value === null || value === undefined ? "–"
  : value.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits }).replace("-", "−");

// events, and what is found in states beside them, in the order of time
const moments = () => [...live.events, ...live.about.moments].sort((a, b) => a.time_s - b.time_s);

function showTimeline() {
  byId("timeline").replaceChildren(...moments().map(({ time_s, text, mass_kg }) => {
    const line = document.createElement("li");
    const mass = mass_kg === null ? "" : `${figuresOf(mass_kg, 1)} kg`;
    line.append(element("span", `${figuresOf(time_s, 3)} s`), element("span", text), element("span", mass, "mass"));
    return line;
  }));
}

function complaint({ time_s, count, level, node, text }) {
  const line = document.createElement("li");
  const times = count > 1 ? `, ${count} times` : "";
  line.append(element("b", level, level.toLowerCase()), ` ${figuresOf(time_s, 2)} s${times}: ${node}: ${text}`);
  return line;
}

function showAbout() {
  const { title, flight, law, note, controls, pace, paused, replayed, phases, land, air, in_air, guidance } = live.about;
  byId("title").textContent = flight ? title : "Waiting for a flight";
  document.title = flight ? `${title}: ${replayed ? "replay" : "live"}` : "Live flight";
  byId("kind").textContent = replayed ? "Replay" : "Live flight";
  byId("who").textContent = flight ? `, ${flight}${law ? `, guidance ${law}` : ""}` : "";
  byId("note").textContent = note;
  byId("note").hidden = !note;
  showAfter();
  globe.land = land ? LAND : [];
  byId("phase").textContent = phases.length ? phases.at(-1).name : "–";
  byId("guidance").textContent = guidance;
  byId("guidance").parentElement.hidden = !guidance;
  for (const gauge of gauges) gauge.hidden = "inAir" in gauge.dataset && !in_air;
  for (const { key } of report.chapters[0].items.filter((item) => item.in_air)) byId(key).hidden = !air;
  const usable = controls && live.connected && !live.about.end;
  for (const button of [playButton, ...paceButtons]) button.disabled = !usable;
  playButton.textContent = paused ? "Play" : "Pause";
  playButton.setAttribute("aria-pressed", String(paused));
  let named = false;
  for (const button of paceButtons) {
    const pressed = Number(button.dataset.pace) === pace;
    named ||= pressed;
    button.setAttribute("aria-pressed", String(pressed));
  }
  byId("pace").textContent = named || pace === null ? "pace" : `pace ×${figuresOf(pace, pace % 1 ? 2 : 0)}`;
  const ways = phases.map(({ name, role }) => [name, role || "quiet"]);
  byId("ways").replaceChildren(...[...ways, ["impact points", "dots"]].map(([name, role]) => {
    const entry = document.createElement("li");
    const sign = signs.find((one) => role === "dots" ? one === signs.at(-1) : one.classList.contains(role));
    entry.append(sign.cloneNode(true), name);
    return entry;
  }));
}

// what it came to, and where its report is: a link while the server can make it
function showAfter() {
  const { verdict, shortcomings, exit_status, report: by, no_report } = live.about;
  byId("after").hidden = !(verdict || by || no_report);
  byId("missed").hidden = !shortcomings.length;
  byId("missed").replaceChildren(...shortcomings.map((line) => element("li", line)));
  byId("exit").hidden = !exit_status;
  byId("exit").textContent = `Exit status ${exit_status}.`;
  const served = by && live.connected && !live.over;
  byId("to-report").hidden = !served;
  byId("no-report").hidden = Boolean(served);
  byId("no-report").replaceChildren(...(by ? ["Its report: ", element("code", by)] : [no_report]));
}

// ---- how things stand

function standing() {
  const { about, over, connected, age, heard } = live;
  const ended = about && about.end;
  const after = about && about.verdict ? about.verdict : ended ? `the last event is ${ended}` : "";
  if (ended) {
    return [`Flight over${after ? `: ${after}` : ""}`, about.verdict && !about.good ? "bad" : about.verdict ? "" : "waiting"];
  }
  if (over) return [about && about.verdict ? about.verdict : "The server has ended, the flight was not over", "bad"];
  const silent = (performance.now() - heard) / 1000;
  if (!connected) return [heard ? `Connection lost ${silent.toFixed(0)} s ago` : "No connection", "bad"];
  if (silent > STALE) return [`No word from the server for ${silent.toFixed(0)} s`, "bad"];
  if (age === null || !about || !about.flight) return ["Waiting for the flight", "waiting"];
  if (about.paused) return ["Paused", "held"];
  if (age + silent > STALE) return [`No data for ${(age + silent).toFixed(0)} s`, "bad"];
  return [about.replayed ? "Playing" : "Live", ""];
}

function showState() {
  const [text, kind] = standing();
  const state = byId("state");
  if (state.textContent !== text) state.textContent = text;
  state.className = `verdict ${kind}`;
  document.documentElement.dataset.state = text;
}

// ---- gauges

function showGauges() {
  const { states, statuses, about, most } = live;
  for (const gauge of gauges) {
    const { key, digits, full, unit } = gauge.dataset;
    // of a flight that is over nothing is to go
    const known = key !== "time_to_go_s" || !about.end;
    const value = !known ? null : key in states.at ? states.last(key) : statuses.last(key);
    gauge.querySelector("b").textContent = figuresOf(value, Number(digits));
    if (!full) continue;
    const limited = full === "limit" && key in about.limits;
    const limit = limited ? about.limits[key] : ["limit", "most"].includes(full) ? most[key] : statuses.last(full);
    const share = limit && value !== null ? Math.min(1, Math.abs(value) / limit) : 0;
    gauge.querySelector("i").style.transform = `scaleX(${share})`;
    const word = limited ? "limit" : full.includes("_") ? "predicted at cut-off" : "most so far";
    gauge.querySelector(".of").textContent = limit ? `${word} ${figuresOf(limit, Math.min(1, digits))}` : "";
    gauge.classList.toggle("beyond", limited && value > limit && !about.idle.includes(key));
  }
  byId("met").textContent = `${figuresOf(states.last("time_s"), 1)} s`;
  byId("rate").textContent = about.paused ? "paused" : about.rate === null ? "–" : `×${figuresOf(about.rate, 1)}`;
}

// ---- globe

function showGlobe() {
  const { states, about } = live;
  const rows = states.rows.length;
  if (!rows) {
    EARTH.flights = [];
    globe.load();
    globe.draw();
    return;
  }
  const time = states.column("time_s");
  const starts = about.phases.map(({ from_s }) => time.findIndex((t) => t >= from_s - 5e-4));
  const falls = states.rows.filter(([, row]) => row[states.at.impact_latitude_deg] !== null);
  EARTH.flights = [{
    name: about.title, role: "here", time_s: time, latitude_deg: states.column("latitude_deg"),
    longitude_deg: states.column("longitude_deg"), height: states.column("height"),
    ways: about.phases.map(({ name, role }, k) => ({
      name, role, first: Math.max(0, starts[k]),
      last: k + 1 < starts.length && starts[k + 1] >= 0 ? starts[k + 1] : rows - 1,
    })),
    impact_longitude_deg: falls.map(([, row]) => row[states.at.impact_longitude_deg]),
    impact_latitude_deg: falls.map(([, row]) => row[states.at.impact_latitude_deg]),
  }];
  EARTH.ends = [about.end ? "end" : "vehicle"];
  globe.load();
  const latitude = states.last("latitude_deg"), longitude = states.last("longitude_deg");
  // from aside, so that the height shows
  const aside = Math.asin(0.2 / Math.max(1, globe.view.zoom)) / RADIANS;
  globe.home = { longitude, latitude: latitude > 0 ? latitude - aside : latitude + aside, zoom: globe.home.zoom };
  if (byId("follow").checked) globe.view = { ...globe.home, zoom: globe.view.zoom };
  globe.draw();
  byId("where").textContent = `over ${Math.abs(latitude).toFixed(2)}° ${latitude < 0 ? "S" : "N"}, `
    + `${Math.abs(longitude).toFixed(2)}° ${longitude < 0 ? "W" : "E"}`;
}

const letGo = () => { byId("follow").checked = false; };
globe.canvas.addEventListener("pointerdown", letGo);
globe.canvas.addEventListener("keydown", (event) => { if (event.key.startsWith("Arrow")) letGo(); });
document.querySelector("[data-zoom='0']").addEventListener("click", () => { byId("follow").checked = true; });
byId("follow").addEventListener("change", () => changed());

// ---- charts: one after the other, so that none holds the page up

const waitingCharts = new Set();
let drawing = false;

function fill(plot) {
  const { states, statuses, events, about } = live;
  const figure = figures[plot.dataset.key];
  const { fields, in_air } = report.chapters[0].items.find(({ key }) => key === plot.dataset.key);
  figure.series.forEach((series, i) => {
    const source = fields[i] in states.at ? states : statuses;
    series.x = source.column("time_s");
    series.y = source.column(fields[i]);
    if (figure.y.log) series.y = series.y.map((y) => y > 0 ? y : null);
  });
  const first = states.rows[0][1][0], last = states.last("time_s");
  const end = Math.max(last, about.end ? last : statuses.last("cutoff_s") || last, first + 1);
  // what is charted in the air ends with it
  const until = in_air ? Math.max(about.left_air_s ?? last, first + 1) : end;
  figure.x.span = [first - 0.01 * (until - first), until + 0.02 * (until - first)];
  figure.instants = marks(in_air ? moments().filter(({ time_s }) => time_s <= until) : events);
  const limit = about.limits[fields[0]];
  if (!limit) return;
  figure.levels = [{ at: limit, text: `limit, ${limit.toLocaleString("en")} ${figure.y.unit}` }];
  // so that the line shows
  if (in_air) figure.y.span = [0, 1.12 * Math.max(limit, live.most[fields[0]] || 0)];
}

// one mark an instant: a word is not printed over another
function marks(events) {
  const found = new Map();
  for (const { time_s, mark } of events) {
    const at = Math.round(time_s * 1000) / 1000;
    if (mark && !found.has(at)) found.set(at, mark);
  }
  return [...found].map(([at, text]) => ({ at, text }));
}

async function drawCharts() {
  if (drawing || !window.Plotly || !live.states.rows.length) return;
  drawing = true;
  for (const plot of waitingCharts) {
    waitingCharts.delete(plot);
    fill(plot);
    await draw(plot);
    await new Promise((resume) => setTimeout(resume));
  }
  drawing = false;
}

// what cannot be seen is drawn when it comes into view
const inView = new Set();
const lookout = new IntersectionObserver((entries) => entries.forEach(({ target, isIntersecting }) => {
  if (isIntersecting) {
    inView.add(target);
    waitingCharts.add(target);
  } else inView.delete(target);
}), { rootMargin: "200px" });
plots.forEach((plot) => lookout.observe(plot));

const hurries = () => Boolean(live.about) && live.about.pace === 0 && !live.about.paused && !live.about.end;

let chartsChanged = false;
let chartsDrawn = 0;
setInterval(() => {
  if (hurries() && performance.now() - chartsDrawn < HURRIED_CHART_PERIOD) return;
  chartsDrawn = performance.now();
  if (chartsChanged) inView.forEach((plot) => waitingCharts.add(plot));
  chartsChanged = false;
  if (waitingCharts.size) drawCharts();
}, CHART_PERIOD);
document.addEventListener("drawn", () => plots.forEach((plot) => waitingCharts.add(plot)));

// ---- one drawing per frame, however many updates

let due = false;
function changed() {
  chartsChanged = true;
  if (due) return;
  due = true;
  if (hurries()) setTimeout(() => requestAnimationFrame(show), HURRIED_PERIOD);
  else requestAnimationFrame(show);
}

function show() {
  due = false;
  live.frames += 1;
  if (!live.about) return;
  showGauges();
  showGlobe();
  showState();
}
setInterval(showState, 250);

// ---- commands

function command(message) {
  byId("answer").textContent = "";
  live.socket.send(JSON.stringify(message));
}
playButton.addEventListener("click", () => {
  command({ command: live.about.paused ? "play" : "pause" });
});
for (const button of paceButtons) {
  button.addEventListener("click", () => command({ command: "pace", value: Number(button.dataset.pace) }));
}

// ---- the connection

function connect() {
  const socket = new WebSocket(`ws://${location.host}/socket${location.search}`);
  live.socket = socket;
  socket.addEventListener("open", () => { live.connected = true; });
  socket.addEventListener("message", ({ data }) => take(JSON.parse(data)));
  socket.addEventListener("close", () => {
    live.connected = false;
    if (live.about) showAbout();
    showState();
    // where the server has said that this is the end, there is nobody to call
    if (!live.over) setTimeout(connect, RETRY_PERIOD);
  });
}
globe.view.zoom = globe.home.zoom = 2.8;
connect();
