// SPDX-License-Identifier: Apache-2.0
// The globe: an orthographic view of the Earth with the flights over it, on a canvas.
const EARTH = report.globe;
const RADIANS = Math.PI / 180;

// places to points on the unit sphere: x, y, z in turn
function onSphere(longitudes, latitudes) {
  const points = new Float64Array(3 * longitudes.length);
  longitudes.forEach((longitude, i) => {
    const a = longitude * RADIANS, b = latitudes[i] * RADIANS;
    points.set([Math.cos(b) * Math.cos(a), Math.cos(b) * Math.sin(a), Math.sin(b)], 3 * i);
  });
  return points;
}

// a ring of land, with points between far ones: along the limb their chord would show
function ringPoints(ring) {
  const longitudes = [], latitudes = [];
  for (let i = 0; i + 3 < ring.length; i += 2) {
    const across = ring[i + 2] - ring[i], turn = across - 360 * Math.round(across / 360);
    const up = ring[i + 3] - ring[i + 1];
    const pieces = Math.max(1, Math.ceil(Math.hypot(turn * Math.cos(ring[i + 1] * RADIANS), up) / 3));
    for (let k = 0; k < pieces; k++) {
      longitudes.push(ring[i] + (turn * k) / pieces);
      latitudes.push(ring[i + 1] + (up * k) / pieces);
    }
  }
  return onSphere(longitudes, latitudes);
}

function graticule() {
  const lines = [];
  const steps = (from, to, by) => Array.from({ length: (to - from) / by + 1 }, (_, i) => from + i * by);
  for (const longitude of steps(-180, 165, 15)) {
    const latitudes = steps(-75, 75, 3);
    lines.push(onSphere(latitudes.map(() => longitude), latitudes));
  }
  for (const latitude of steps(-75, 75, 15)) {
    const longitudes = steps(-180, 180, 3);
    lines.push(onSphere(longitudes, longitudes.map(() => latitude)));
  }
  return lines;
}

// a value between the points of a rising list of times; the ends hold beyond it
function place(times, t) {
  let low = 0, high = times.length - 1;
  if (t <= times[0] || high === 0) return [0, 0];
  if (t >= times[high]) return [high, 0];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle; else high = middle;
  }
  const gap = times[high] - times[low];
  return [low, gap > 0 ? (t - times[low]) / gap : 0];
}

class Globe {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
    this.land = EARTH.land.map(ringPoints);
    this.areas = EARTH.areas.map(ringPoints);
    this.lines = graticule();
    this.load();
    this.home = this.firstView();
    this.time = Infinity;
    this.view = { ...this.home };
    this.paint();
    this.waiting = false;
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  // the flights, as they are by now
  load() {
    const placed = (flight) => ({
      ...flight,
      ground: onSphere(flight.longitude_deg, flight.latitude_deg),
      impact: onSphere(flight.impact_longitude_deg, flight.impact_latitude_deg),
    });
    this.flights = EARTH.flights.map(placed);
    this.falls = (EARTH.falls || []).map(placed);
  }

  // over the middle of the ways, from aside so that heights show, so near that they fill the view
  firstView() {
    const middle = [0, 0, 0];
    let far = 0;
    for (const { ground, height } of this.flights) {
      const count = height.length;
      for (let i = 0; i < count; i += Math.max(1, count >> 6)) {
        for (let k = 0; k < 3; k++) middle[k] += ground[3 * i + k];
      }
    }
    const size = Math.hypot(...middle) || 1;
    for (const { ground, height } of this.flights) {
      height.forEach((h, i) => {
        const across = (ground[3 * i] * middle[0] + ground[3 * i + 1] * middle[1] + ground[3 * i + 2] * middle[2]) / size;
        far = Math.max(far, (1 + h) * Math.sqrt(Math.max(0, 1 - across * across)), across < 0 ? 1 + h : 0);
      });
    }
    const latitude = Math.asin(middle[2] / size) / RADIANS;
    const zoom = Math.min(EARTH.nearest, Math.max(0.1, 0.95 / far));
    const aside = Math.asin(Math.min(0.4, 0.4 / zoom)) / RADIANS;
    return {
      longitude: Math.atan2(middle[1], middle[0]) / RADIANS,
      latitude: latitude > 0 ? latitude - aside : latitude + aside,
      zoom,
    };
  }

  paint() {
    this.colours = Object.fromEntries(
      ["ground", "panel", "ink", "quiet", "edge", "faint", "link", "here", "other", "third", "thesis", "otis", "fourth", "fifth", "sixth"]
        .map((name) => [name, colour(name)]),
    );
    this.font = `13px ${FONT.family}`;
    this.draw();
  }

  turn(across, up) {
    this.view.longitude = ((this.view.longitude + across + 540) % 360) - 180;
    this.view.latitude = Math.max(-90, Math.min(90, this.view.latitude + up));
    this.draw();
  }

  zoom(factor) {
    this.view.zoom = factor ? Math.max(0.1, Math.min(40, this.view.zoom * factor)) : this.home.zoom;
    if (!factor) this.view = { ...this.home };
    this.draw();
  }

  show(time) {
    this.time = time;
    this.draw();
  }

  // one drawing per frame, however many changes
  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.render();
    });
  }

  prepare() {
    const { canvas, pen, view } = this;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    this.x = width / 2;
    this.y = height / 2;
    this.radius = 0.47 * Math.min(width, height) * view.zoom;
    const a = view.longitude * RADIANS, b = view.latitude * RADIANS;
    const [ca, sa, cb, sb] = [Math.cos(a), Math.sin(a), Math.cos(b), Math.sin(b)];
    this.right = [-sa, ca, 0];
    this.up = [-sb * ca, -sb * sa, cb];
    this.near = [cb * ca, cb * sa, sb];
  }

  // to the screen: x, y in pixels, and the depth towards the reader in radii
  at(points, i, scale = 1) {
    const p = points[3 * i] * scale, q = points[3 * i + 1] * scale, r = points[3 * i + 2] * scale;
    const { right, up, near } = this;
    return [
      this.x + this.radius * (p * right[0] + q * right[1]),
      this.y - this.radius * (p * up[0] + q * up[1] + r * up[2]),
      p * near[0] + q * near[1] + r * near[2],
    ];
  }

  render() {
    this.prepare();
    const { pen, colours } = this;
    pen.lineJoin = pen.lineCap = "round";
    this.ways(true);
    pen.beginPath();
    pen.arc(this.x, this.y, this.radius, 0, 2 * Math.PI);
    pen.fillStyle = colours.ground;
    pen.fill();
    this.fillLand();
    this.strokes(this.lines, colours.edge, 0.7);
    this.strokes(this.land, colours.quiet, 0.9, [], true);
    pen.beginPath();
    pen.arc(this.x, this.y, this.radius, 0, 2 * Math.PI);
    pen.strokeStyle = colours.edge;
    pen.lineWidth = 1.2;
    pen.stroke();
    for (const flight of this.flights) {
      this.strokes([flight.impact], this.several ? colours[flight.role] : colours.quiet, 1.6, [1.5, 5]);
      if (!flight.faint) this.strokes([flight.ground], colours.quiet, 1.2);
    }
    this.ways(false);
    this.strokes(this.areas, colours[EARTH.areas_role], 1.6, [], true);
    this.words = [];
    this.flights.forEach((flight, i) => this.marks(flight, EARTH.ends[i]));
    for (const fall of this.falls) {
      const paint = colours[this.several ? fall.role : "quiet"];
      this.mark(fall, fall.height.length - 1, 0, paint, this.several ? "" : fall.name, 3.5);
    }
  }

  get several() { return this.flights.length > 1; }

  // what lies behind is pushed out to the limb, so that each ring stays closed
  fillLand() {
    const { pen } = this;
    pen.beginPath();
    for (const ring of this.land) {
      const { path, turned, front, behind } = this.pushed(ring);
      if (!front) continue;
      path.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      pen.closePath();
      // land lies to the right of its ring: one that goes round the wrong way has its land behind
      // the limb, and what it leaves free is the water
      if (behind && turned < -Math.PI) {
        pen.moveTo(this.x + this.radius, this.y);
        pen.arc(this.x, this.y, this.radius, 0, 2 * Math.PI);
      }
    }
    pen.fillStyle = this.colours.edge;
    pen.fill("evenodd");
  }

  // a ring on the screen, how far it goes round the middle, how much of it is in front and behind
  pushed(ring) {
    const count = ring.length / 3;
    const path = [];
    let front = 0, turned = 0, last = null;
    for (let i = 0; i <= count; i++) {
      const [x, y, depth] = this.at(ring, i % count);
      const across = x - this.x, down = y - this.y;
      const angle = Math.atan2(down, across);
      let turn = last ? angle - last.angle : 0;
      turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
      turned += turn;
      if (depth >= 0) {
        front += 1;
        path.push([x, y]);
      } else {
        // along the limb, not across the Earth
        const pieces = last && last.depth < 0 ? Math.ceil(Math.abs(turn) / 0.05) || 1 : 1;
        for (let k = pieces - 1; k >= 0; k--) {
          const limb = angle - (turn * k) / pieces;
          path.push([this.x + this.radius * Math.cos(limb), this.y + this.radius * Math.sin(limb)]);
        }
      }
      last = { angle, depth };
    }
    return { path, turned, front, behind: count + 1 - front };
  }

  // lines on the surface, their front half only
  strokes(lines, paint, width, dash = [], closed = false) {
    const { pen } = this;
    pen.beginPath();
    for (const line of lines) {
      const count = line.length / 3;
      let down = false;
      for (let i = 0; i < count + (closed ? 1 : 0); i++) {
        const [x, y, depth] = this.at(line, i % count);
        if (depth < 0) { down = false; continue; }
        if (down) pen.lineTo(x, y); else pen.moveTo(x, y);
        down = true;
      }
    }
    pen.setLineDash(dash);
    pen.strokeStyle = paint;
    pen.lineWidth = width;
    pen.stroke();
    pen.setLineDash([]);
  }

  // the ways of the flights: what is behind the Earth before it is drawn, the rest after
  ways(behind) {
    const { pen, colours } = this;
    // an optimum lies over the flight that follows it, which shows through its gaps
    const above = (flight) => flight.over ? 1 : 0;
    const drawn = [...this.flights, ...this.falls].sort((a, b) => above(a) - above(b));
    for (const flight of drawn) {
      for (const way of flight.ways) {
        pen.beginPath();
        let down = false;
        for (let i = way.first; i <= way.last; i++) {
          const [x, y, depth] = this.at(flight.ground, i, 1 + flight.height[i]);
          if ((depth < 0) !== behind) { down = false; continue; }
          if (down) pen.lineTo(x, y); else pen.moveTo(x, y);
          down = true;
        }
        pen.strokeStyle = way.role ? colours[way.role] : this.several ? colours[flight.role] : colours.quiet;
        const pointed = flight === this.pointed;
        pen.lineWidth = flight.faint && !pointed ? 1.1 : way.role ? 3 : 1.8;
        pen.setLineDash(!way.role ? (flight.over ? [2, 6] : [7, 5]) : flight.over ? [9, 9] : []);
        pen.globalAlpha = behind ? 0.45 : flight.faint && !pointed ? 0.6 : 1;
        pen.stroke();
      }
    }
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }

  // begin, end and vehicle
  marks(flight, end) {
    const last = flight.height.length - 1;
    const paint = this.colours[this.several ? flight.role : "ink"];
    if (flight.faint) return this.mark(flight, last, 0, paint, "", flight === this.pointed ? 4.5 : 2.5);
    this.mark(flight, 0, 0, paint, this.several ? "" : "start", 4);
    this.mark(flight, last, 0, paint, EARTH.nearest > 1 ? "" : this.several ? flight.name : end, 4);
    if (EARTH.nearest > 1) return;
    const [i, share] = place(flight.time_s, this.time);
    this.stem(flight, i, share);
    this.mark(flight, i, share, this.several ? paint : this.colours.link, "", 6.5);
  }

  // the flight whose way is nearest to a place on the canvas, and no farther than a finger's width
  nearest(x, y) {
    let best = null, least = coarse ? 22 : 10;
    for (const flight of this.flights) {
      flight.height.forEach((height, i) => {
        const point = this.at(flight.ground, i, 1 + height);
        const away = Math.hypot(point[0] - x, point[1] - y);
        if (away < least && !this.hidden(point)) { best = flight; least = away; }
      });
    }
    return best;
  }

  // the vehicle's point between two states
  vehicle(flight, i, share, high) {
    const j = Math.min(i + 1, flight.height.length - 1);
    const between = (list, a, b) => list[a] + share * (list[b] - list[a]);
    const point = [0, 1, 2].map((k) => between(flight.ground, 3 * i + k, 3 * j + k));
    const size = Math.hypot(...point);
    return this.at(point, 0, (high ? 1 + between(flight.height, i, j) : 1) / size);
  }

  hidden([x, y, depth]) {
    return depth < 0 && Math.hypot(x - this.x, y - this.y) < this.radius;
  }

  stem(flight, i, share) {
    const top = this.vehicle(flight, i, share, true), foot = this.vehicle(flight, i, share, false);
    if (this.hidden(foot)) return;
    this.pen.beginPath();
    this.pen.moveTo(foot[0], foot[1]);
    this.pen.lineTo(top[0], top[1]);
    this.pen.strokeStyle = this.colours.ink;
    this.pen.lineWidth = 1.2;
    this.pen.stroke();
  }

  mark(flight, i, share, paint, text, size) {
    const point = this.vehicle(flight, i, share, true);
    if (this.hidden(point)) return;
    const { pen, colours } = this;
    const [x, y] = point;
    pen.beginPath();
    pen.arc(x, y, size, 0, 2 * Math.PI);
    pen.fillStyle = paint;
    pen.fill();
    pen.strokeStyle = size > 5 ? colours.ink : colours.panel;
    pen.lineWidth = size > 5 ? 2 : 1.5;
    pen.stroke();
    // where the mark cannot be seen, its word would stand at the edge
    if (text && x >= 0 && x <= 2 * this.x) this.word(text, x, y);
  }

  // a word beside its mark, below the words that are there already
  word(text, x, y) {
    const { pen, colours } = this;
    pen.font = this.font;
    const width = pen.measureText(text).width;
    const left = Math.min(Math.max(2, x - width / 2), 2 * this.x - width - 2);
    let top = y + 20;
    for (const [otherLeft, otherTop, otherWidth] of this.words) {
      const aside = left > otherLeft + otherWidth || otherLeft > left + width;
      if (!aside && Math.abs(top - otherTop) < 17) top = otherTop + 17;
    }
    this.words.push([left, top, width]);
    pen.lineWidth = 4;
    pen.strokeStyle = colours.panel;
    pen.strokeText(text, left, top);
    pen.fillStyle = colours.ink;
    pen.fillText(text, left, top);
  }
}

// fingers, mouse, wheel and keys
function handle(globe) {
  const { canvas } = globe;
  const held = new Map();
  const degrees = () => 57.3 / globe.radius;
  const apart = () => {
    const [a, b] = [...held.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const from = held.get(event.pointerId);
    if (!from) return;
    const before = held.size === 2 ? apart() : 0;
    held.set(event.pointerId, [event.clientX, event.clientY]);
    if (before) globe.zoom(apart() / before || 1);
    else globe.turn((from[0] - event.clientX) * degrees(), (event.clientY - from[1]) * degrees());
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => held.delete(event.pointerId));
  }
  // two fingers are for the globe, one for the page as well
  canvas.addEventListener("touchmove", (event) => {
    if (event.touches.length > 1) event.preventDefault();
  }, { passive: false });
  // a page that is scrolled on does not stop at the globe: the pointer must have come to it
  let pointed = false;
  canvas.addEventListener("pointermove", (event) => {
    pointed ||= event.movementX !== 0 || event.movementY !== 0;
  });
  canvas.addEventListener("pointerleave", () => { pointed = false; });
  canvas.addEventListener("wheel", (event) => {
    if (!pointed && !event.ctrlKey) return;
    event.preventDefault();
    globe.zoom(Math.exp(-0.0015 * Math.max(-200, Math.min(200, event.deltaY))));
  }, { passive: false });
  const step = () => Math.min(10, 40 * degrees());
  const keys = {
    ArrowLeft: () => globe.turn(-step(), 0), ArrowRight: () => globe.turn(step(), 0),
    ArrowUp: () => globe.turn(0, step()), ArrowDown: () => globe.turn(0, -step()),
    "+": () => globe.zoom(1.25), "=": () => globe.zoom(1.25), "-": () => globe.zoom(0.8),
    Home: () => globe.zoom(0), " ": () => document.querySelector(".play")?.click(),
  };
  canvas.addEventListener("keydown", (event) => {
    const act = keys[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  document.querySelectorAll(".zoom button").forEach((button) => {
    button.addEventListener("click", () => globe.zoom(Number(button.dataset.zoom)));
  });
}

// a flight that is pointed at says which one it is, where the page has a place for that
function name(globe, said) {
  const asked = said.textContent;
  const point = (event) => {
    const box = globe.canvas.getBoundingClientRect();
    const flight = globe.nearest(event.clientX - box.left, event.clientY - box.top);
    if (flight === (globe.pointed || null)) return;
    globe.pointed = flight;
    said.textContent = flight ? flight.name : asked;
    globe.draw();
  };
  globe.canvas.addEventListener("pointermove", point);
  globe.canvas.addEventListener("pointerdown", point);
}

const globe = new Globe(document.querySelector(".scene canvas"));
handle(globe);
document.querySelectorAll(".pointed").forEach((said) => name(globe, said));
document.addEventListener("drawn", () => globe.paint());
