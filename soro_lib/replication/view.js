// Draws shaded tubes in three dimensions on a plain canvas: no WebGL, nothing to download.
// Drag turns the view, the wheel zooms, a double click resets it.

const FRESH = { azimuth: -0.9, elevation: 0.32, zoom: 1 };
const AXES = ["#D55E00", "#009E73", "#0072B2"];

function mix(hex, other, share) {
  const parse = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16));
  const [a, b] = [parse(hex), parse(other)];
  return `rgb(${a.map((value, i) => Math.round(value + (b[i] - value) * share)).join(",")})`;
}

// Returns a function from scene coordinates [m] to {x, y, depth} on the canvas, and its scale [pixels/m].
function camera(scene, view, width, height) {
  const centre = scene.low.map((low, i) => (low + scene.high[i]) / 2);
  const radius = Math.hypot(...scene.low.map((low, i) => scene.high[i] - low)) / 2;
  const scale = (view.zoom * Math.min(width, height * 1.15)) / (1.75 * radius);
  const [ca, sa] = [Math.cos(view.azimuth), Math.sin(view.azimuth)];
  const [ce, se] = [Math.cos(view.elevation), Math.sin(view.elevation)];
  const project = (point) => {
    const [x, y] = [point[0] - centre[0], (point[1] - centre[1]) * scene.up];
    const z = (point[2] - centre[2]) * scene.up;
    const right = x * ca + y * sa;
    const away = -x * sa + y * ca;
    const depth = away * ce - z * se;
    const perspective = (5 * radius) / (5 * radius + depth);
    return {
      x: width / 2 + right * scale * perspective,
      y: height / 2 - (z * ce + away * se) * scale * perspective,
      depth,
      scale: scale * perspective,
    };
  };
  return project;
}

function line(context, from, to, color, width) {
  context.strokeStyle = color;
  context.lineWidth = width;
  context.beginPath();
  context.moveTo(from.x, from.y);
  context.lineTo(to.x, to.y);
  context.stroke();
}

function drawFloor(context, scene, project, ink) {
  const level = scene.up > 0 ? scene.low[2] : scene.high[2];
  const [low, high, step] = [scene.low, scene.high, scene.grid];
  context.globalAlpha = 0.16;
  for (const axis of [0, 1]) {
    const other = 1 - axis;
    for (let value = Math.ceil(low[axis] / step) * step; value <= high[axis] + 1e-9; value += step) {
      const ends = [low[other], high[other]].map((end) => {
        const point = [0, 0, level];
        point[axis] = value;
        point[other] = end;
        return project(point);
      });
      line(context, ends[0], ends[1], ink, 1);
    }
  }
  // The shadow tells how far the arm leans.
  context.globalAlpha = 0.13;
  context.lineCap = "round";
  context.lineJoin = "round";
  for (const tube of scene.tubes) {
    const points = tube.points.map((point) => project([point[0], point[1], level]));
    context.strokeStyle = ink;
    context.lineWidth = 2 * tube.radius * points[0].scale;
    context.beginPath();
    points.forEach((point, i) => (i ? context.lineTo(point.x, point.y) : context.moveTo(point.x, point.y)));
    context.stroke();
  }
  context.globalAlpha = 1;
}

function drawBase(context, scene, project) {
  const size = 3.2 * Math.max(...scene.tubes.map((tube) => tube.radius));
  const rim = Array.from({ length: 49 }, (_, i) => {
    const angle = (i / 48) * 2 * Math.PI;
    return project([size * Math.cos(angle), size * Math.sin(angle), 0]);
  });
  context.beginPath();
  rim.forEach((point, i) => (i ? context.lineTo(point.x, point.y) : context.moveTo(point.x, point.y)));
  context.fillStyle = "#9a9a9a";
  context.strokeStyle = "#6b6b6b";
  context.lineWidth = 1;
  context.fill();
  context.stroke();
}

function drawPiece(context, { from, to, radius, color }) {
  const [dx, dy] = [to.x - from.x, to.y - from.y];
  const length = Math.hypot(dx, dy);
  const [near, half] = [radius * from.scale, radius * to.scale];
  // The light comes from the upper left: the bright line lies on that side of the tube.
  let [nx, ny] = length > 1e-6 ? [-dy / length, dx / length] : [-0.6, -0.8];
  if (nx + ny > 0) [nx, ny] = [-nx, -ny];
  const gradient = context.createLinearGradient(
    from.x + nx * half, from.y + ny * half, from.x - nx * half, from.y - ny * half);
  gradient.addColorStop(0, mix(color, "#000000", 0.25));
  gradient.addColorStop(0.3, mix(color, "#ffffff", 0.5));
  gradient.addColorStop(0.55, color);
  gradient.addColorStop(1, mix(color, "#000000", 0.5));
  context.fillStyle = gradient;
  context.beginPath();
  context.moveTo(from.x + nx * near, from.y + ny * near);
  context.lineTo(to.x + nx * half, to.y + ny * half);
  context.lineTo(to.x - nx * half, to.y - ny * half);
  context.lineTo(from.x - nx * near, from.y - ny * near);
  context.fill();
  context.beginPath();
  context.arc(to.x, to.y, half, 0, 2 * Math.PI);
  context.fill();
}

function drawTubes(context, scene, project) {
  const pieces = [];
  for (const tube of scene.tubes) {
    const points = tube.points.map(project);
    for (let i = 1; i < points.length; i++) {
      const [from, to] = [points[i - 1], points[i]];
      pieces.push({ from, to, radius: tube.radius, color: tube.color, depth: (from.depth + to.depth) / 2 });
    }
  }
  pieces.sort((a, b) => b.depth - a.depth).forEach((piece) => drawPiece(context, piece));
}

function drawTip(context, scene, project) {
  const pose = scene.tip;
  const origin = pose.slice(0, 3).map((row) => row[3]);
  const start = project(origin);
  const length = Math.max(scene.grid * 0.6, 2.5 * scene.tubes[0].radius);
  AXES.forEach((color, axis) => {
    const end = project(origin.map((value, i) => value + pose[i][axis] * length));
    line(context, start, end, color, 2.5);
    context.fillStyle = color;
    context.font = "600 12px sans-serif";
    context.fillText("xyz"[axis], end.x + 3, end.y - 3);
  });
}

function render({ model, el }) {
  const canvas = document.createElement("canvas");
  canvas.className = "soro-view";
  canvas.style.cssText = "width:100%;height:430px;display:block;cursor:grab;touch-action:none";
  canvas.setAttribute("role", "img");
  el.appendChild(canvas);
  let view = { ...FRESH };
  let pending = false;

  function draw() {
    pending = false;
    const scene = model.get("scene");
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !scene.tubes) return;
    const ratio = window.devicePixelRatio || 1;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const ink = getComputedStyle(canvas).color;
    const project = camera(scene, view, width, height);
    // A standing arm stands on its base plate; a hanging arm hides it only when seen from below.
    drawFloor(context, scene, project, ink);
    drawBase(context, scene, project);
    drawTubes(context, scene, project);
    drawTip(context, scene, project);
    context.fillStyle = ink;
    context.font = "12px sans-serif";
    context.fillText(scene.caption, 10, height - 10);
    canvas.setAttribute("aria-label", scene.caption);
  }
  const redraw = () => {
    if (!pending) {
      pending = true;
      requestAnimationFrame(draw);
    }
  };

  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!canvas.hasPointerCapture(event.pointerId)) return;
    view.azimuth -= event.movementX * 0.008;
    view.elevation = Math.max(-1.5, Math.min(1.5, view.elevation + event.movementY * 0.008));
    redraw();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    view.zoom = Math.max(0.4, Math.min(6, view.zoom * Math.exp(-event.deltaY * 0.001)));
    redraw();
  }, { passive: false });
  canvas.addEventListener("dblclick", () => {
    view = { ...FRESH };
    redraw();
  });
  const observer = new ResizeObserver(redraw);
  observer.observe(canvas);
  model.on("change:scene", redraw);
  redraw();
  return () => {
    observer.disconnect();
    model.off("change:scene", redraw);
  };
}

export default { render };
