// Be the operator: two views of the task, and a hand made of pointer, wheel and keys.
// Time-stamped inputs go to Python in batches, one batch under way at a time; Python answers with a frame.
// The clock of the trial runs only while the page is looked at and Python keeps up.

const BATCH = 33; // ms between batches
const PATIENCE = 300; // ms to wait for Python before the clock is held
const WHEEL = 0.0002; // m per pixel of the wheel: 20 mm a notch
const SPEED = { lateral: 0.2, vertical: 0.25 }; // m/s of the keys
const RING = 0.03; // m: the trial begins when the pointer comes this near to the tip
const FORCE = 0.02; // m drawn per N

const INK = { force: "#0072B2", goal: "#D55E00", arm: "#009E73", items: ["#0072B2", "#E69F00", "#CC79A7"] };
const KEYS = {
  ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down",
  KeyW: [2, -1], KeyS: [2, 1], PageUp: [2, -1], PageDown: [2, 1],
};

const ABOVE = { left: [0, -1], right: [0, 1], up: [1, -1], down: [1, 1] }; // arrows seen from above
const AWAY = { left: [1, -1], right: [1, 1], up: [0, 1], down: [0, -1] }; // arrows beside the camera

const STYLE = `
.soro-operator { outline: none; font: 13px var(--jp-ui-font-family, sans-serif);
  color: var(--jp-ui-font-color1, #222); border: 1px solid var(--jp-border-color2, #ccc); border-radius: 8px;
  overflow: hidden; background: var(--jp-layout-color1, #fff); }
.soro-operator:focus { border-color: var(--jp-brand-color1, #1976d2); }
.soro-operator canvas { display: block; width: 100%; touch-action: none; }
.soro-operator.driving canvas { cursor: none; }
.soro-operator .strip, .soro-operator .bar { display: flex; align-items: center; padding: 0 14px; gap: 24px;
  height: 48px; white-space: nowrap; overflow: hidden; }
.soro-operator .strip { border-bottom: 1px solid var(--jp-border-color2, #ccc); }
.soro-operator .bar { border-top: 1px solid var(--jp-border-color2, #ccc); height: 52px; }
.soro-operator .word { flex: 1; font-size: 14px; }
.soro-operator .word.urgent { font-weight: 600; }
.soro-operator .clock { font: 600 24px var(--jp-code-font-family, monospace); }
.soro-operator .phases { display: flex; gap: 5px; align-items: center; flex: 1; }
.soro-operator .phase { padding: 2px 9px; border-radius: 10px; background: var(--jp-layout-color2, #eee);
  opacity: 0.65; }
.soro-operator .phase.now { background: #0072B2; color: white; opacity: 1; font-weight: 600; }
.soro-operator .number { display: inline-flex; flex-direction: column; min-width: 84px; font-size: 11px; }
.soro-operator .number b { font: 600 14px var(--jp-code-font-family, monospace); }
.soro-operator .keys { padding: 7px 14px; font-size: 12px; background: var(--jp-layout-color2, #f5f5f5);
  display: flex; flex-wrap: wrap; gap: 3px 18px; }
.soro-operator kbd { font: 11px var(--jp-code-font-family, monospace); border: 1px solid currentColor;
  border-radius: 3px; padding: 0 4px; opacity: 0.85; }
.soro-operator .note { padding: 0 14px 7px; font-size: 12px; background: var(--jp-layout-color2, #f5f5f5);
  overflow-wrap: anywhere; opacity: 0.85; }
.soro-operator button { font: inherit; font-weight: 600; padding: 5px 16px; margin-right: 14px; border: 0;
  border-radius: 5px; background: #0072B2; color: white; cursor: pointer; }
`;

// --- Drawing -------------------------------------------------------------------------------------------

// A view of the workspace: `right` and `down` are the directions [3] that run to the right and to the bottom, `from`
// and `to` the corners seen along them [m].
function panel(kind, title, left, top, scale, right, down, from, to) {
  const along = (direction, point) => direction[0] * point[0] + direction[1] * point[1] + direction[2] * point[2];
  return {
    kind, title, left, top, scale,
    width: (to[0] - from[0]) * scale,
    height: (to[1] - from[1]) * scale,
    at: (point) => [left + (along(right, point) - from[0]) * scale, top + (along(down, point) - from[1]) * scale],
    // x and y of a pixel, where the view is one from above
    place: (x, y) => [0, 1].map((axis) =>
      right[axis] * ((x - left) / scale + from[0]) + down[axis] * ((y - top) / scale + from[1])),
  };
}

const [MARGIN, HEAD] = [14, 30];

// Two views side by side: from above and from the front; or, as the study's operators work, a camera that looks along x
// and downwards, and beside it nothing but the hand.
function layout(scene, width) {
  const [low, high, tilt] = [scene.low, scene.high, scene.elevation];
  const [x, y, z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const size = tilt ? [high[1] - low[1], high[0] - low[0]] : [high[0] - low[0], high[2] - low[2]];
  const scale = Math.min((width - 3 * MARGIN) / 2 / size[0], tilt ? 600 : 640);
  const left = (width - 2 * size[0] * scale - MARGIN) / 2;
  const next = left + size[0] * scale + MARGIN;
  const common = { height: HEAD + size[1] * scale + MARGIN };
  if (!tilt) {
    const above = panel("above", "from above: pointer = x, y", left, HEAD, scale, x, y, [low[0], low[1]], [high[0], high[1]]);
    const front = panel("front", "from the front: wheel = height", next, HEAD, scale, x, z, [low[0], low[2]], [high[0], high[2]]);
    return { ...common, pad: above, all: [above, front] };
  }
  const back = [-1, 0, 0];
  const sight = [-Math.sin(tilt), 0, Math.cos(tilt)];
  const top = -0.06;
  const pad = panel("pad", "your hand: pointer = x (away), y", left, HEAD, scale, y, back, [low[1], -high[0]], [high[1], -low[0]]);
  const camera = panel("camera", "camera", next, HEAD, scale, y, sight, [low[1], top], [high[1], top + size[1]]);
  return { ...common, pad, all: [pad, camera] };
}

function stroke(context, points, color, width, dash = []) {
  context.strokeStyle = color;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
  context.setLineDash([]);
}

function disc(context, [x, y], radius, fill, edge, width = 1.5) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  if (fill) {
    context.fillStyle = fill;
    context.fill();
  }
  if (edge) {
    context.strokeStyle = edge;
    context.lineWidth = width;
    context.stroke();
  }
}

// Lines every 0.1 m along two axes, at the height of the table.
function drawGrid(context, view, scene, ink, axes) {
  context.globalAlpha = 0.13;
  for (const axis of axes) {
    for (let value = Math.ceil(scene.low[axis] * 10) / 10; value <= scene.high[axis]; value += 0.1) {
      const ends = [[...scene.low], [...scene.high]];
      ends.forEach((end) => {
        if (!axes.includes(2)) end[2] = scene.table;
        end[axis] = value;
      });
      stroke(context, ends.map(view.at), ink, 1);
    }
  }
  context.globalAlpha = 1;
}

function drawRoom(context, view, scene, ink) {
  drawGrid(context, view, scene, ink, view.kind === "front" ? [0, 2] : [0, 1]);
  if (view.kind !== "front") return;
  const [left, surface] = view.at([scene.low[0], 0, scene.table]);
  context.fillStyle = ink;
  context.globalAlpha = 0.15;
  context.fillRect(left, surface, view.width, view.top + view.height - surface);
  context.globalAlpha = 0.5;
  if (scene.lifted) {
    stroke(context, [scene.low[0], scene.high[0]].map((x) => view.at([x, 0, scene.lifted])), ink, 1, [2, 5]);
    context.font = "11px sans-serif";
    context.fillText("lifted", view.left + 4, view.at([0, 0, scene.lifted])[1] - 4);
  }
  context.globalAlpha = 1;
}

// A round body in the light from the upper left.
function drawBody(context, view, tip, alpha) {
  const [from, to] = [view.at([0, 0, 0]), view.at(tip)];
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy);
  let [nx, ny] = length > 1 ? [-dy / length, dx / length] : [-0.6, -0.8];
  if (nx + ny > 0) [nx, ny] = [-nx, -ny];
  const radius = 0.035 * view.scale;
  const shade = context.createLinearGradient(
    from[0] + nx * radius, from[1] + ny * radius, from[0] - nx * radius, from[1] - ny * radius);
  shade.addColorStop(0, "#00704f");
  shade.addColorStop(0.32, "#8fd9c1");
  shade.addColorStop(0.6, INK.arm);
  shade.addColorStop(1, "#005138");
  context.globalAlpha = alpha;
  context.lineCap = "round";
  stroke(context, [from, to], shade, 2 * radius);
  context.lineCap = "butt";
  context.globalAlpha = 1;
  if (view.kind !== "above") {
    context.fillStyle = "#8a8a8a";
    context.fillRect(from[0] - 0.09 * view.scale, from[1], 0.18 * view.scale, 0.022 * view.scale);
  } else disc(context, from, 0.05 * view.scale, null, "#8a8a8a", 2);
}

function drawTargets(context, view, scene) {
  const flatness = { above: 1, front: 0.12, camera: Math.sin(scene.elevation) }[view.kind];
  scene.targets.forEach(([tx, ty], i) => {
    const [x, y] = view.at([tx, ty, scene.table]);
    context.beginPath();
    context.ellipse(x, y, 0.05 * view.scale, 0.05 * view.scale * flatness, 0, 0, 2 * Math.PI);
    context.fillStyle = context.strokeStyle = INK.items[i % 3];
    context.globalAlpha = 0.14;
    context.fill();
    context.globalAlpha = 1;
    context.lineWidth = 2;
    context.stroke();
  });
}

function drawItems(context, view, scene, frame) {
  const side = 0.05 * view.scale;
  const farFirst = frame.items.map((item, i) => [item, i]).sort(([a], [b]) => b[0] - a[0]);
  for (const [item, i] of farFirst) {
    const [x, y] = view.at(item);
    const lid = view.kind === "camera" ? side * Math.sin(scene.elevation) : 0;
    const face = view.kind === "camera" ? side * Math.cos(scene.elevation) : side;
    context.fillStyle = INK.items[i % 3];
    context.fillRect(x - side / 2, y - (face + lid) / 2, side, face + lid);
    context.fillStyle = "#ffffff66";
    context.fillRect(x - side / 2, y - (face + lid) / 2, side, lid);
    context.fillStyle = "white";
    context.font = "600 13px sans-serif";
    context.textAlign = "center";
    context.fillText(i + 1, x, y + lid / 2 + 5);
    context.textAlign = "left";
    const seen = frame.status === "running" && view.kind !== "camera";
    if (seen && frame.reachable === i) disc(context, [x, y], 0.048 * view.scale, null, INK.items[i % 3], 3);
  }
}

function drawGoal(context, view, frame) {
  if (!frame.goal || frame.status === "done") return;
  const [x, y] = view.at(frame.goal);
  stroke(context, [[x - 6, y - 6], [x + 6, y + 6]], INK.goal, 2.5);
  stroke(context, [[x - 6, y + 6], [x + 6, y - 6]], INK.goal, 2.5);
}

// Gripper: a ring while open, full while closed.
function drawTip(context, view, frame, { closed, ink, paper }) {
  disc(context, view.at(frame.tip), 0.016 * view.scale, closed ? ink : paper, ink, 2.5);
}

function drawForce(context, view, frame, place) {
  if (!frame.force || Math.hypot(...frame.force) < 0.02) return;
  const [from, end] = [place, place.map((value, axis) => value + FORCE * frame.force[axis])].map(view.at);
  const angle = Math.atan2(end[1] - from[1], end[0] - from[0]);
  const head = [2.6, -2.6].map((turn) => [end[0] + 10 * Math.cos(angle + turn), end[1] + 10 * Math.sin(angle + turn)]);
  stroke(context, [from, end], INK.force, 4);
  stroke(context, [head[0], end, head[1]], INK.force, 4);
  context.fillStyle = INK.force;
  context.font = "600 12px sans-serif";
  const label = [end[0] + 22 * Math.cos(angle) - 14, end[1] + 22 * Math.sin(angle) + 4];
  context.fillText(`${Math.hypot(...frame.force).toFixed(1)} N`, ...label);
}

// The pointer, the hand that the force has pulled away from it, and the force itself.
function drawHand(context, view, { scene, frame, aim, ink }) {
  if (scene.automation.every((share) => share === 1)) return;
  const hand = aim.map((value, axis) => value + (frame.give ? frame.give[axis] : 0));
  const free = (point) => point.map((value, axis) =>
    scene.automation[axis] < 1 ? value : (frame.desired || frame.tip)[axis]);
  const [from, to] = [aim, hand].map((point) => view.at(free(point)));
  if (Math.hypot(to[0] - from[0], to[1] - from[1]) > 3) {
    context.globalAlpha = 0.6;
    stroke(context, [from, to], ink, 1.2, [3, 3]);
    disc(context, from, 3.5, ink);
    context.globalAlpha = 1;
  }
  disc(context, to, 9, null, ink, 1.6);
  stroke(context, [[to[0] - 14, to[1]], [to[0] + 14, to[1]]], ink, 1.2);
  stroke(context, [[to[0], to[1] - 14], [to[0], to[1] + 14]], ink, 1.2);
  drawForce(context, view, frame, free(hand));
}

function drawView(context, view, state) {
  const { scene, frame, trail, ink, armed } = state;
  context.fillStyle = ink;
  context.font = "600 12px sans-serif";
  context.fillText(view.title, view.left, view.top - 11);
  context.save();
  context.beginPath();
  context.rect(view.left, view.top, view.width, view.height);
  context.clip();
  drawRoom(context, view, scene, ink);
  if (view.kind !== "pad") {
    if (view.kind !== "above") drawBody(context, view, frame.tip, view.kind === "camera" ? 0.75 : 0.9);
    drawTargets(context, view, scene);
    drawItems(context, view, scene, frame);
    if (view.kind === "above") drawBody(context, view, frame.tip, 0.38);
    context.globalAlpha = 0.4;
    stroke(context, trail.map(view.at), ink, 1.4);
    context.globalAlpha = 1;
    drawGoal(context, view, frame);
    drawTip(context, view, frame, state);
  }
  const pad = view.kind === "above" || view.kind === "pad";
  if (armed && pad) disc(context, view.at(scene.start), RING * view.scale, null, INK.goal, 3);
  if (view.kind === "camera") drawForce(context, view, frame, frame.tip);
  else drawHand(context, view, state);
  context.restore();
}

// --- The page ------------------------------------------------------------------------------------------

function element(parent, tag, className = "") {
  const made = document.createElement(tag);
  made.className = className;
  parent.appendChild(made);
  return made;
}

const METRICS = [
  ["time T", "time_s", "s", 2], ["path L", "path_m", "m", 3], ["mean force H", "assistance_n", "N", 3],
  ["error, item 1", "item1_error_mm", "mm", 1], ["error, item 2", "item2_error_mm", "mm", 1],
];

function metricsText(metrics) {
  return METRICS.map(([label, name, unit, digits]) => {
    const value = metrics?.[name];
    const text = value === null || value === undefined ? "–" : `${value.toFixed(digits)} ${unit}`;
    return `<span class="number">${label}<b data-metric="${name}">${text}</b></span>`;
  }).join("");
}

function keysText(scene) {
  const entries = [];
  const free = scene.automation.map((share) => share < 1);
  if (free[0]) entries.push("pointer or <kbd>arrows</kbd> x, y");
  if (free[2]) entries.push("wheel or <kbd>W</kbd> <kbd>S</kbd> up, down");
  entries.push("<kbd>space</kbd> close, open gripper");
  if (scene.confirms) entries.push("<kbd>enter</kbd> report: item in the gripper, gone again");
  entries.push("<kbd>esc</kbd> stop");
  if (!free[0]) entries.push("the machine steers");
  if (!free[2]) entries.push("the machine grows and retracts");
  return entries.map((entry) => `<span>${entry}</span>`).join("");
}

const ENDINGS = { done: "Both items are placed.", "time out": "Time is up.", stopped: "Stopped.", failed: "Failed." };

// What the operator should do next.
function hint(frame, scene, { closed, confirmed }) {
  const item = `item ${frame.goalItem + 1}`;
  const held = frame.held >= 0;
  if (scene.confirms && held && closed && !confirmed) return "Report the item: <kbd>enter</kbd>";
  if (scene.confirms && !held && !closed && confirmed) return "Report it gone: <kbd>enter</kbd>";
  if (frame.phase.startsWith("lifting")) return "The machine lifts.";
  if (held) return closed ? `Bring ${item} to its disc and open the gripper: <kbd>space</kbd>` : "Letting go ...";
  if (closed) return "The gripper has caught nothing; open it: <kbd>space</kbd>";
  return frame.reachable >= 0 && !scene.elevation ? "Close the gripper: <kbd>space</kbd>" : `Bring the tip to ${item}.`;
}

// The line above the drawing: what to do, or why the clock stands.
function wordText(frame, scene, hand, { armed, paused, waiting, elsewhere }) {
  if (armed) return "Bring the pointer into the ring on the left, or press <kbd>enter</kbd>: the clock starts.";
  if (paused) return "Paused. Click into the drawing to go on.";
  if (waiting) return "Waiting for the kernel; the clock is held.";
  if (frame.status === "running" && !elsewhere) return hint(frame, scene, hand);
  const before = elsewhere ? "This trial is driven from another page." : ENDINGS[frame.status];
  const button = `<button type="button">${before ? "Another trial" : "Start a trial"}</button>`;
  return button + (before || "Place item 1, then item 2, on the disc of its colour.");
}

function render({ model, el }) {
  const root = element(el, "div", "soro-operator");
  root.tabIndex = 0;
  root.dataset.lmSuppressShortcuts = "true"; // the keys are ours, not JupyterLab's
  element(root, "style").textContent = STYLE;
  const strip = element(root, "div", "strip");
  const word = element(strip, "span", "word");
  const clockText = element(strip, "span", "clock");
  const canvas = element(root, "canvas");
  canvas.setAttribute("role", "img");
  const bar = element(root, "div", "bar");
  const phases = element(bar, "span", "phases");
  const metrics = element(bar, "span");
  const keys = element(root, "div", "keys");
  const note = element(root, "div", "note");

  const scene = () => model.get("scene");
  const frame = () => model.get("frame");
  let hand = null; // of the trial under way: run, clock, aim, buttons, inputs to be sent
  let [held, trail, views] = [new Set(), [], null];
  const shown = new Map();
  let [last, raf] = [performance.now(), 0];

  const focused = () => root.contains(document.activeElement) && document.hasFocus();
  const live = () => hand && hand.run === frame().run && ["armed", "running"].includes(frame().status);
  const armed = () => live() && !hand.begun;
  const paused = () => live() && hand.begun && !focused();
  const waiting = () => live() && hand.sentAt !== null && performance.now() - hand.sentAt > PATIENCE;
  const elsewhere = () => !live() && ["armed", "running"].includes(frame().status);
  const driving = () => live() && hand.begun && !paused() && !waiting();
  const clamp = (value, axis) => Math.max(scene().low[axis], Math.min(scene().high[axis], value));

  function takeUp() {
    hand = {
      run: frame().run, begun: false, clock: 0, aim: [...scene().start], closed: false, confirmed: false,
      inputs: [], seq: 0, sentAt: null, sendAfter: 0,
    };
    [held, trail] = [new Set(), []];
    root.focus({ preventScroll: true });
  }

  function onFrame() {
    const now = frame();
    if (now.status === "armed" && (!hand || hand.run !== now.run) && asked) takeUp();
    if (hand && now.run === hand.run && now.seq === hand.seq) hand.sentAt = null;
    if (now.status === "running") trail.push(now.tip);
    root.dataset.status = now.status;
    root.dataset.file = now.file || "";
    write();
  }

  let asked = false; // this page drives only the trials that it has asked for
  function start() {
    asked = true;
    model.send({ type: "start" });
  }

  function setHtml(node, html) {
    if (shown.get(node) === html) return; // leave alone what stands there: a button may be under the pointer
    shown.set(node, html);
    node.innerHTML = html;
  }

  function write() {
    const [now, fixed] = [frame(), scene()];
    clockText.textContent = `${(now.time || 0).toFixed(2)} s`;
    const item = `item ${(now.goalItem || 0) + 1}`;
    setHtml(phases, [`<b>${item}</b>`, ...fixed.phases.map((name) =>
      `<span class="phase${now.phase === name ? " now" : ""}">${name}</span>`)].join(""));
    setHtml(metrics, metricsText(now.metrics));
    setHtml(keys, keysText(fixed));
    const place = now.file ? `recorded in ${now.file}` : `trials are recorded in ${fixed.folder}`;
    note.textContent = now.message || place + (now.skipped ? `; ${now.skipped} unreadable inputs skipped` : "");
    const [x, y, z] = now.tip.map((value) => (1000 * value).toFixed(1));
    const words = now.held >= 0 ? `item ${now.held + 1} held` : "nothing held";
    canvas.setAttribute("aria-label", `${fixed.title}, ${now.phase || now.status}: tip at (${x}, ${y}, ${z}) mm, ${words}`);
  }

  function draw() {
    const [width, fixed, now] = [canvas.clientWidth, scene(), frame()];
    const why = { armed: armed(), paused: paused(), waiting: waiting(), elsewhere: elsewhere() };
    setHtml(word, wordText(now, fixed, hand, why));
    word.classList.toggle("urgent", why.armed || why.paused || why.waiting);
    root.classList.toggle("driving", Boolean(driving()));
    if (!width || !fixed.low) return;
    views = layout(fixed, width);
    const ratio = window.devicePixelRatio || 1;
    canvas.style.height = `${views.height}px`;
    canvas.width = width * ratio;
    canvas.height = views.height * ratio;
    canvas.dataset.pad = JSON.stringify([[0, 0, 0], [1, 0, 0], [0, 1, 0]].map(views.pad.at));
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const { color: ink, backgroundColor: paper } = getComputedStyle(root);
    const own = hand && hand.run === now.run;
    const state = {
      scene: fixed, frame: now, trail, ink, paper, armed: why.armed,
      aim: own ? hand.aim : now.tip, closed: own && hand.closed,
    };
    for (const view of views.all) drawView(context, view, state);
  }

  // What the operator does is noted at every frame of the screen while the clock runs, and sent in batches.
  function noteInput() {
    const { clock, aim, closed, confirmed } = hand;
    hand.inputs.push([clock, ...aim.map((value) => Math.round(value * 1e6) / 1e6), Number(closed), Number(confirmed)]);
  }

  function send(now) {
    if (hand.sentAt !== null || now < hand.sendAfter || !hand.inputs.length) return;
    hand.seq += 1;
    [hand.sentAt, hand.sendAfter] = [now, now + BATCH];
    model.send({ type: "inputs", run: hand.run, seq: hand.seq, inputs: hand.inputs });
    hand.inputs = [];
  }

  function tick(now) {
    const elapsed = Math.min(now - last, 100) / 1000;
    last = now;
    if (driving()) {
      for (const code of held) {
        const [axis, sign] = scene().elevation ? AWAY[KEYS[code]] || KEYS[code] : ABOVE[KEYS[code]] || KEYS[code];
        const speed = axis === 2 ? SPEED.vertical : SPEED.lateral;
        hand.aim[axis] = clamp(hand.aim[axis] + sign * speed * elapsed, axis);
      }
      hand.clock += elapsed;
      noteInput();
    }
    if (live()) send(now);
    draw();
    raf = requestAnimationFrame(tick);
  }

  canvas.addEventListener("pointermove", (event) => {
    if (!live() || !views) return;
    const box = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    if (x > views.pad.left + views.pad.width + MARGIN / 2) return; // over the other view
    const place = views.pad.place(x, y);
    const away = Math.hypot(place[0] - scene().start[0], place[1] - scene().start[1]);
    if (!hand.begun && away < RING) hand.begun = true;
    if (driving()) place.forEach((value, axis) => (hand.aim[axis] = clamp(value, axis)));
  });
  canvas.addEventListener("wheel", (event) => {
    if (!driving()) return;
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
    hand.aim[2] = clamp(hand.aim[2] + pixels * WHEEL, 2);
  }, { passive: false });
  root.addEventListener("pointerdown", (event) => {
    if (event.target.tagName !== "BUTTON") root.focus({ preventScroll: true });
  });
  word.addEventListener("click", (event) => event.target.tagName === "BUTTON" && start());
  root.addEventListener("keydown", (event) => {
    if (!live() || event.ctrlKey || event.metaKey || event.altKey) return;
    const known = event.code in KEYS || ["Space", "Enter", "Escape"].includes(event.code);
    if (!known) return;
    event.preventDefault();
    event.stopPropagation();
    if (event.code in KEYS) held.add(event.code);
    if (event.repeat) return;
    if (event.code === "Escape") model.send({ type: "stop" });
    else if (event.code === "Enter" && !hand.begun) hand.begun = true;
    else if (event.code === "Enter") hand.confirmed = !hand.confirmed;
    else if (event.code === "Space" && driving()) hand.closed = !hand.closed;
  });
  root.addEventListener("keyup", (event) => held.delete(event.code));
  root.addEventListener("focusout", () => held.clear());

  model.on("change:frame", onFrame);
  model.on("change:scene", write);
  onFrame();
  raf = requestAnimationFrame(tick);
  return () => {
    cancelAnimationFrame(raf);
    model.off("change:frame", onFrame);
    model.off("change:scene", write);
  };
}

export default { render };
